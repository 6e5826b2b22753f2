#include "berth/network/configuration_uploads.hpp"

#include "berth/eds/xdd.hpp"
#include "berth/manager/configuration_upload.hpp"
#include "berth/manager/stored_dcf.hpp"
#include "berth/network/slave_requests.hpp"
#include "berth/od/cia302.hpp"

namespace berth::network {

namespace cia302 = od::cia302;
using od::AbortCode;

AbortCode ConfigurationUploads::request(std::uint8_t sub, std::uint32_t value) {
  return request_of_slaves(*network_, sub, value, signature,
                           [this](const NetworkSlave& slave) { return begin(slave); });
}

void ConfigurationUploads::end() noexcept {
  scope_.cancel();
  for (auto& state : states_) {
    if (state == State::under_way) state = State::failed;
  }
}

bool ConfigurationUploads::begin(const NetworkSlave& slave) {
  const bool boots = !is_settled(*network_, slave.node);
  State& state = states_[slave.node.value()];
  if (boots || state == State::under_way) return false;
  state = State::under_way;
  scope_.spawn(upload(slave.node, slave.target->objects()));
  return true;
}

rt::Task<void> ConfigurationUploads::upload(NodeId node, co::SdoAccess& device) {
  auto done = co_await upload_into(node, device);
  states_[node.value()] = done ? State::done : State::failed;
  if (callback_) callback_(node, done);
}

rt::Task<Result<void>> ConfigurationUploads::upload_into(NodeId node, co::SdoAccess& device) {
  auto text = co_await eds_of(node, device);
  if (!text) co_return fail(text.error());
  const auto reading = eds::read_any(std::move(*text), "EDS");
  if (!reading.usable()) co_return fail(Errc::invalid, "its EDS cannot be read");
  const auto uploaded = co_await manager::upload_configuration(device, reading.file, node);
  if (!uploaded) co_return fail(uploaded.error());
  co_return store(node, uploaded->dcf);
}

rt::Task<Result<std::string>> ConfigurationUploads::eds_of(NodeId node, co::SdoAccess& device) {
  const auto kept = values_->bytes({cia302::store_eds, node.value()});
  if (!kept.empty()) {
    co_return manager::unpack_stored(
        values_->get_or<std::uint8_t>({cia302::eds_format, node.value()}, manager::stored_format::ascii), kept);
  }
  co_return co_await manager::read_own_eds(device);
}

Result<void> ConfigurationUploads::store(NodeId node, const std::string& dcf) {
  const std::uint8_t sub = node.value();
  const auto loaded = manager::read_configuration(dcf, "1F20h");
  if (!loaded.usable()) return fail(Errc::invalid, "what was read of it makes no DCF");
  auto format = values_->get_or<std::uint8_t>({cia302::dcf_format, sub}, manager::stored_format::ascii);
  const std::vector<std::uint8_t> plain(dcf.begin(), dcf.end());
  const bool as_it_is =
      format == manager::stored_format::ascii && values_->set_bytes({cia302::store_dcf, sub}, plain) == AbortCode::none;
  if (!as_it_is) {
    format = manager::stored_format::zlib;
    const auto stored = values_->set_bytes({cia302::store_dcf, sub}, manager::pack_stored(dcf));
    if (stored != AbortCode::none) return fail(Errc::mismatch, "1F20h has no room for its DCF");
  }
  static_cast<void>(values_->set({cia302::dcf_format, sub}, format));
  // Writes to objects that this manager does not have fail, which does no harm.
  constexpr std::array<std::uint8_t, 4> empty{};
  static_cast<void>(values_->set_bytes({cia302::concise_dcf, sub}, empty));
  const manager::ConfigurationDate& date = loaded.configuration.date;
  static_cast<void>(values_->set({cia302::configuration_date, sub}, date.days));
  static_cast<void>(values_->set({cia302::configuration_time, sub}, date.ms));
  return {};
}

}  // namespace berth::network
