#include "berth/co/sdo_servers.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/od/cia301.hpp"

namespace berth::co {
namespace {

using namespace od::cia301;
constexpr std::uint8_t request_sub = 1, response_sub = 2, node_sub = 3;
constexpr std::uint8_t highest_node = 127;

CobId cob_id(const od::Values& values, ObjectRef ref) noexcept {
  return CobId(values.get_or<std::uint32_t>(ref, CobId::invalid_bit));
}

SdoChannel channel_of(const od::Values& values, std::uint16_t index) noexcept {
  const SdoChannel channel{cob_id(values, {index, request_sub}), cob_id(values, {index, response_sub})};
  const bool usable = channel.valid() && channel.request.allowed() && channel.response.allowed();
  return usable ? channel : SdoChannel{};
}

// CiA 301 §7.5.2.33: bits 29..0 must not change while the channel is valid.
AbortCode check_cob_id(CobId before, CobId after) noexcept {
  if (!after.well_formed()) return AbortCode::invalid_value;
  if (!after.valid()) return AbortCode::none;
  if (before.valid()) return before.same_identifier(after) ? AbortCode::none : AbortCode::invalid_value;
  return after.allowed() ? AbortCode::none : AbortCode::invalid_value;
}

}  // namespace

std::optional<SdoClientChannel> client_channel(const od::Values& values, unsigned number) noexcept {
  if (number < 1 || number > last_client - first_client + 1U) return std::nullopt;
  const auto index = static_cast<std::uint16_t>(first_client + number - 1);
  const auto channel = channel_of(values, index);
  if (!channel.valid()) return std::nullopt;
  const auto node = values.get_or<std::uint8_t>({index, node_sub}, 0);
  return SdoClientChannel{channel, node >= 1 && node <= highest_node ? NodeId(node) : NodeId()};
}

SdoServers::SdoServers(can::Dispatcher& dispatcher, od::Values& values, std::size_t buffer)
    : dispatcher_(&dispatcher), values_(&values), buffer_(buffer), first_(dispatcher, values, buffer) {
  bool any = false;
  for (const od::Object& object : values.description().objects()) {
    if (!od::within(object.index, default_server, last_client)) continue;
    any = true;
    if (od::within(object.index, first_server, last_server)) {
      additional_.push_back({.index = object.index, .service = nullptr});
    }
  }
  additional_.shrink_to_fit();
  values.channels().serve(this);
  if (any) values.attach(*this, default_server, last_client);
}

SdoServers::~SdoServers() {
  if (values_->channels().servers() == this) values_->channels().serve(nullptr);
}

void SdoServers::start(NodeId node) {
  running_ = true;
  first_.start(node);
  for (auto& server : additional_) apply(server);
}

void SdoServers::stop() noexcept {
  running_ = false;
  first_.stop();
  for (auto& server : additional_) {
    if (server.service) server.service->stop();
  }
}

void SdoServers::apply(Additional& server) {
  const auto channel = running_ ? channel_of(*values_, server.index) : SdoChannel{};
  if (!channel.valid()) {
    if (server.service) server.service->stop();
    return;
  }
  if (!server.service) {
    const auto channel_number = static_cast<std::uint8_t>(server.index - default_server);
    server.service = std::make_unique<SdoServerService>(*dispatcher_, *values_, buffer_, channel_number);
    server.service->set_timeout(timeout_);
  }
  if (server.service->channel() != channel) server.service->start(channel);
}

void SdoServers::set_timeout(rt::Duration timeout) noexcept {
  timeout_ = timeout;
  first_.set_timeout(timeout);
  for (auto& server : additional_) {
    if (server.service) server.service->set_timeout(timeout);
  }
}

bool SdoServers::busy() const noexcept {
  return first_.busy() || std::ranges::any_of(additional_, [](const Additional& server) {
           return server.service && server.service->busy();
         });
}

bool SdoServers::complete(ObjectRef object, AbortCode code) noexcept {
  bool any = first_.complete(object, code);
  for (auto& server : additional_) {
    if (server.service && server.service->complete(object, code)) any = true;
  }
  values_->channels().completed(object, code);
  return any;
}

bool SdoServers::answer(std::uint8_t channel, ObjectRef object, AbortCode code, ObjectRef named) noexcept {
  SdoServerService* const one = service(channel);
  return one != nullptr && one->complete(object, code, named);
}

bool SdoServers::send(std::uint8_t channel, od::ChannelBytes bytes) noexcept {
  SdoServerService* const one = service(channel);
  return one != nullptr && one->send(bytes);
}

SdoServerService* SdoServers::service(std::uint8_t channel) noexcept {
  if (channel == 0) return &first_;
  const auto index = static_cast<std::uint16_t>(default_server + channel);
  const auto server = std::ranges::find(additional_, index, &Additional::index);
  return server == additional_.end() ? nullptr : server->service.get();
}

std::size_t SdoServers::additional() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(
      additional_, [](const Additional& server) { return server.service && server.service->running(); }));
}

std::size_t SdoServers::memory() const noexcept {
  std::size_t bytes = first_.memory() + additional_.capacity() * sizeof(Additional);
  for (const auto& server : additional_) {
    if (server.service) bytes += sizeof(SdoServerService) + server.service->memory();
  }
  return bytes;
}

AbortCode SdoServers::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  const bool shown = ref.index == default_server && (ref.sub == request_sub || ref.sub == response_sub);
  if (!shown || !first_.running() || value.size() != shown_.size()) return AbortCode::none;
  const auto channel = first_.channel();
  store_le(shown_.data(), (ref.sub == request_sub ? channel.request : channel.response).raw());
  value = shown_;
  return AbortCode::none;
}

AbortCode SdoServers::writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.sub == request_sub || ref.sub == response_sub) {
    if (ref.index == default_server) return AbortCode::read_only;
    if (value.size() != 4) return AbortCode::none;  // the description has another type than CiA 301: no effect
    return check_cob_id(cob_id(values, ref), CobId(load_le<std::uint32_t>(value.data())));
  }
  const bool bad_node = ref.sub == node_sub && value.size() == 1 && (value[0] < 1 || value[0] > highest_node);
  return bad_node ? AbortCode::invalid_value : AbortCode::none;
}

void SdoServers::written(od::Values&, ObjectRef ref) noexcept {
  const auto server = std::ranges::find(additional_, ref.index, &Additional::index);
  if (server != additional_.end()) apply(*server);
}

}  // namespace berth::co
