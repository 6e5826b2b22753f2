#include "berth/manager/sdo_requests.hpp"

#include "berth/base/bytes.hpp"
#include "berth/od/cia302.hpp"

namespace berth::manager {
namespace {

using od::AbortCode;
using od::cia302::connection_state;
using od::cia302::release_sdo;
using od::cia302::request_sdo;

constexpr std::size_t most_waiting = 32;

}  // namespace

void add_sdo_manager_objects(od::DescriptionBuilder& builder, std::uint8_t most) {
  builder.variable(request_sdo, {.name = "Request SDO"});
  builder.variable(release_sdo, {.name = "Release SDO"});
  builder.object(connection_state, od::ObjectCode::array, "Dynamic SDO connection state", od::DataType::unsigned32);
  for (std::uint8_t sub = 1; sub <= most; ++sub) {
    builder.sub(connection_state, {.sub = sub, .name = "Dynamic SDO connection state", .access = od::Access::ro});
  }
}

SdoRequests::SdoRequests(can::Dispatcher& dispatcher, co::SdoClient& sdo, od::Values& values)
    : dispatcher_(&dispatcher), sdo_(&sdo), scope_(dispatcher.executor()) {
  values.attach(*this, request_sdo, release_sdo);
  values.attach(*this, connection_state);
}

void SdoRequests::begin(SdoManagerOptions options) {
  end();
  manager_.emplace(*dispatcher_, *sdo_, std::move(options));
  scope_.spawn(recover());
}

SdoManager* SdoRequests::manager_for_request() {
  if (!manager_ && when_asked_) {
    auto options = when_asked_();
    if (options) begin(std::move(*options));
  }
  return manager_ ? &*manager_ : nullptr;
}

void SdoRequests::end() noexcept {
  scope_.cancel();
  manager_.reset();
  last_.fill({});
}

rt::Task<void> SdoRequests::recover() { co_await manager_->recover(); }

rt::Task<void> SdoRequests::connect(NodeId client, NodeId server, rt::Duration lease) {
  const auto made = co_await manager_->connect(client, server, lease);
  Last& last = last_[client.value()];
  last.state = made ? State::connected : State::failed;
  last.object = made ? made->client_object : std::uint16_t{0};
}

rt::Task<void> SdoRequests::release(NodeId client, NodeId server) {
  const auto released = co_await manager_->disconnect(client, server);
  last_[client.value()] = {released ? State::released : State::failed, server.value(), 0};
}

AbortCode SdoRequests::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index != connection_state || ref.sub == 0 || ref.sub >= last_.size()) return AbortCode::none;
  const Last& last = last_[ref.sub];
  const auto word =
      static_cast<std::uint32_t>(last.state) | std::uint32_t{last.server} << 8U | std::uint32_t{last.object} << 16U;
  store_le(shown_.data(), word);
  value = shown_;
  return AbortCode::none;
}

AbortCode SdoRequests::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index == connection_state) return AbortCode::none;
  if (manager_for_request() == nullptr || scope_.running() >= most_waiting) return AbortCode::device_state;
  const auto client = NodeId::make(value[0]);
  const auto server = NodeId::make(value[1]);
  const bool two = client && server && client->configured() && server->configured() && *client != *server;
  if (!two) return AbortCode::invalid_value;
  if (ref.index == release_sdo) {
    scope_.spawn(release(*client, *server));
    return AbortCode::none;
  }
  last_[client->value()] = {State::under_way, server->value(), 0};
  const std::chrono::seconds lease(load_le<std::uint16_t>(value.data() + 2));
  scope_.spawn(connect(*client, *server, lease));
  return AbortCode::none;
}

}  // namespace berth::manager
