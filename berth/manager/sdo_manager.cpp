#include "berth/manager/sdo_manager.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"
#include "berth/od/cia301.hpp"

namespace berth::manager {
namespace {

using namespace od::cia301;
constexpr std::uint8_t request_sub = 1, response_sub = 2, other_sub = 3;
constexpr std::uint32_t dynamic_request = 0x6E0;
constexpr std::size_t most_requests = 32;  // that wait

bool is_client(std::uint16_t object) noexcept { return object >= first_client; }

Result<void> check(NodeId client, NodeId server) noexcept {
  const bool two = client.configured() && server.configured() && client != server;
  if (two) return {};
  return fail(Errc::invalid, "an SDO connection is between two nodes with node-IDs");
}

}  // namespace

SdoManager::SdoManager(can::Dispatcher& dispatcher, co::SdoClient& sdo, SdoManagerOptions options)
    : dispatcher_(&dispatcher),
      sdo_(&sdo),
      options_(std::move(options)),
      connections_(options_.pool),
      heartbeats_(dispatcher, *this),
      lease_over_(*this, dispatcher.executor()),
      scope_(dispatcher.executor()) {
  heartbeats_.set_never_seen_time(options_.heartbeat);
  dispatcher.add(co::all_error_control, *this);
  dispatcher.add(can::only(dynamic_request), *this);
}

SdoManager::~SdoManager() = default;

void SdoManager::end() noexcept {
  scope_.cancel();
  works_ = false;
  due_.clear();
  lease_over_.cancel();
  heartbeats_.clear();
  connections_.clear();
  unread_.reset();
}

// ---- received frames ------------------------------------------------------------------------------------------------

void SdoManager::received(const can::Frame& frame, rt::Time) noexcept {
  if (frame.remote) return;
  if (frame.key() == dynamic_request) {
    const bool asks = options_.hears_requests && frame.size == 2 && scope_.running() < most_requests;
    const auto client = NodeId::make(frame.data[0]);
    const auto server = NodeId::make(frame.data[1]);
    if (asks && client && server) scope_.spawn(answer(*client, *server));
    return;
  }
  const NodeId node(static_cast<std::uint8_t>(frame.key() & 0x7FU));
  const bool booted = frame.size == 1 && frame.data[0] == 0;
  const bool concerns = std::ranges::any_of(
      connections_.all(), [&](const SdoConnection& c) { return c.client == node || c.server == node; });
  const bool waits = std::ranges::any_of(due_, [&](const Due& due) { return due.node == node && !due.lost; });
  // The node is there, and may have channels that belong to no connection: checked whenever it is heard, until it was
  // read.
  const bool to_be_read = unread_.test(node.value()) || connections_.holds(node);
  if (waits || !(to_be_read || (booted && concerns))) return;
  due_.push_back({node, false});
  if (!std::exchange(works_, true)) scope_.spawn(work());
}

void SdoManager::heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept {
  using Kind = co::HeartbeatEvent::Kind;
  const bool lost = event.kind == Kind::lost || event.kind == Kind::never_seen;
  if (!lost && event.kind != Kind::recovered) return;
  due_.push_back({event.node, lost});
  if (!std::exchange(works_, true)) scope_.spawn(work());
}

void SdoManager::lease_over() noexcept { scope_.spawn(expire()); }

void SdoManager::arm() noexcept {
  rt::Time next = rt::never;
  for (const auto& connection : connections_.all()) next = std::min(next, connection.until);
  lease_over_.cancel();
  if (next != rt::never) dispatcher_->executor().at(next, lease_over_);
}

void SdoManager::tell() {
  arm();
  if (changed_) changed_();
}

void SdoManager::supervise(NodeId node) {
  if (options_.heartbeat.count() > 0 && !heartbeats_.supervised(node)) heartbeats_.supervise(node, options_.heartbeat);
}

rt::Task<void> SdoManager::work() {
  while (!due_.empty()) {
    co_await turn_.take();
    const rt::Held held(turn_);
    const Due due = due_.front();
    due_.pop_front();
    co_await look_at(due.node, due.lost);
  }
  works_ = false;
}

rt::Task<void> SdoManager::expire() {
  co_await turn_.take();
  const rt::Held held(turn_);
  const std::vector<SdoConnection> all(connections_.all().begin(), connections_.all().end());
  for (const auto& connection : all) {
    if (connection.until > dispatcher_->executor().now()) continue;
    co_await take_back(connection);
  }
  arm();
}

rt::Task<void> SdoManager::answer(NodeId client, NodeId server) {
  const rt::Duration by_default{};
  const auto made = co_await connect(client, server, by_default);
  static_cast<void>(made);  // the frame has no answer: the client finds its channel, or none
}

// ---- one end --------------------------------------------------------------------------------------------------------

// A channel object of a node. Errc::aborted: it has no such object.
rt::Task<Result<ChannelEnd>> SdoManager::read_end(NodeId node, std::uint16_t object) {
  ChannelEnd end{.node = node, .object = object, .ids = {}, .other = {}};
  const auto request = co_await sdo_->read<std::uint32_t>(node, object, request_sub);
  if (!request) co_return fail(request.error());
  const auto response = co_await sdo_->read<std::uint32_t>(node, object, response_sub);
  if (!response) co_return fail(response.error());
  const auto other = co_await sdo_->read<std::uint8_t>(node, object, other_sub);
  end.other = other ? NodeId::make(*other).value_or(NodeId()) : NodeId();
  const co::CobId asks(*request), answers(*response);
  end.ids = {asks.id(), answers.id()};
  end.valid = asks.valid() && answers.valid();
  co_return end;
}

rt::Task<Result<std::uint16_t>> SdoManager::free_object(NodeId node, std::uint16_t first, std::uint16_t last) {
  for (std::uint16_t object = first; object <= last; ++object) {
    if (connections_.uses(node, object)) continue;
    const auto end = co_await read_end(node, object);
    if (!end && end.error().code != Errc::aborted) co_return fail(end.error());
    if (!end) break;
    if (!end->valid) co_return object;
  }
  const char* const what =
      first == first_client ? "no free SDO client channel (1280h ff.)" : "no free SDO server channel (1201h ff.)";
  co_return fail(Error{.code = Errc::not_found, .node = node.value(), .text = what});
}

rt::Task<Result<void>> SdoManager::write_end(ChannelEnd end) {
  const auto named = co_await sdo_->write<std::uint8_t>(end.node, end.object, other_sub, end.other.value());
  const bool silent = !named && named.error().code != Errc::aborted;  // not every device has this sub-index
  if (silent) co_return named;
  const auto request = co_await sdo_->write<std::uint32_t>(end.node, end.object, request_sub, end.ids.request);
  if (!request) co_return request;
  co_return co_await sdo_->write<std::uint32_t>(end.node, end.object, response_sub, end.ids.response);
}

// A COB-ID that could not be invalidated stays held for the node.
rt::Task<bool> SdoManager::clear_end(ChannelEnd end) {
  const std::uint32_t request = end.ids.request | co::CobId::invalid_bit;
  const std::uint32_t response = end.ids.response | co::CobId::invalid_bit;
  const auto first = co_await sdo_->write<std::uint32_t>(end.node, end.object, request_sub, request);
  if (!first) connections_.hold(end.ids.request, end.node);
  const auto second = co_await sdo_->write<std::uint32_t>(end.node, end.object, response_sub, response);
  if (!second) connections_.hold(end.ids.response, end.node);
  const bool cleared = first && second;
  if (!cleared) supervise(end.node);
  co_return cleared;
}

// ---- nodes ----------------------------------------------------------------------------------------------------------

// The node's ends with identifiers of the pool. False: it did not answer.
rt::Task<bool> SdoManager::read_node(NodeId node, std::vector<ChannelEnd>& ends) {
  const std::pair<std::uint16_t, std::uint16_t> ranges[] = {{first_server, last_server}, {first_client, last_client}};
  for (const auto& [first, last] : ranges) {
    for (std::uint16_t object = first; object <= last; ++object) {
      const auto end = co_await read_end(node, object);
      if (!end && end.error().code != Errc::aborted) co_return false;
      if (!end) break;
      const bool ours = connections_.in_pool(end->ids.request) || connections_.in_pool(end->ids.response);
      if (end->valid && ours) ends.push_back(*end);
    }
  }
  co_return true;
}

// Invalidates the channels of a node that belong to no connection.
rt::Task<Result<void>> SdoManager::clean(NodeId node) {
  std::vector<ChannelEnd> ends;
  const bool answers = co_await read_node(node, ends);
  if (!answers)
    co_return fail(Error{.code = Errc::timeout, .node = node.value(), .text = "its SDO channels cannot be read"});
  bool all = true;
  for (const auto& each : ends) {
    const ChannelEnd end = each;
    if (connections_.uses(node, end.object)) continue;
    const bool cleared = co_await clear_end(end);
    all = all && cleared;
  }
  if (!all)
    co_return fail(Error{.code = Errc::timeout, .node = node.value(), .text = "its SDO channels cannot be cleared"});
  connections_.unhold(node);
  unread_.reset(node.value());
  co_return Result<void>{};
}

rt::Task<void> SdoManager::recover() {
  co_await turn_.take();
  const rt::Held held(turn_);
  std::vector<ChannelEnd> ends;
  for (const NodeId node : options_.nodes) {
    const bool answers = co_await read_node(node, ends);
    if (!answers) unread_.set(node.value());
  }
  std::vector<ChannelEnd> left;
  for (const auto& client : ends) {
    if (!is_client(client.object)) continue;
    const auto fits = [&](const ChannelEnd& e) {
      return !is_client(e.object) && e.node == client.other && e.ids == client.ids &&
             (e.other == client.node || !e.other.configured());
    };
    const auto server = std::ranges::find_if(ends, fits);
    const bool once = std::ranges::count_if(ends, [&](const ChannelEnd& e) {
                        return e.ids.request == client.ids.request || e.ids.response == client.ids.response;
                      }) == 2;
    if (server == ends.end() || !once || !connections_.claim(client.ids)) continue;
    connections_.add({client.node, server->node, client.object, server->object, client.ids,
                      dispatcher_->executor().now() + options_.lease});
    supervise(client.node);
    supervise(server->node);
  }
  for (const auto& each : ends) {
    const ChannelEnd end = each;
    if (!connections_.uses(end.node, end.object)) co_await clear_end(end);
  }
  tell();
}

// ---- connections ----------------------------------------------------------------------------------------------------

rt::Task<Result<SdoConnection>> SdoManager::connect(NodeId client, NodeId server, rt::Duration lease) {
  const auto good = check(client, server);
  if (!good) co_return fail(good.error());
  co_await turn_.take();
  const rt::Held held(turn_);
  if (connections_.find(client, server) == nullptr) {
    const auto made = co_await make(client, server);
    if (!made) co_return fail(made.error());
    connections_.add(*made);
  }
  SdoConnection& connection = *connections_.find(client, server);
  connection.until = dispatcher_->executor().now() + (lease.count() > 0 ? lease : options_.lease);
  const SdoConnection given = connection;
  tell();
  co_return given;
}

rt::Task<Result<SdoConnection>> SdoManager::make(NodeId client, NodeId server) {
  const NodeId both[] = {client, server};
  for (const NodeId node : both) {
    if (!connections_.holds(node) && !unread_.test(node.value())) continue;
    const auto cleaned = co_await clean(node);
    if (!cleaned) co_return fail(cleaned.error());
  }
  const auto server_object = co_await free_object(server, first_server, last_server);
  if (!server_object) co_return fail(server_object.error());
  const auto client_object = co_await free_object(client, first_client, last_client);
  if (!client_object) co_return fail(client_object.error());
  const auto ids = connections_.take();
  if (!ids) co_return fail(Errc::unsupported, "no CAN-ID is left for an SDO channel");
  const SdoConnection made{client, server, *client_object, *server_object, *ids};
  auto written = co_await write_end(server_end(made));
  const bool half = written.has_value();
  if (half) written = co_await write_end(client_end(made));
  if (!written) {
    if (half) co_await clear_end(client_end(made));
    co_await clear_end(server_end(made));
    connections_.put_back(*ids);
    co_return fail(written.error());
  }
  supervise(client);
  supervise(server);
  co_return made;
}

rt::Task<Result<void>> SdoManager::disconnect(NodeId client, NodeId server) {
  co_await turn_.take();
  const rt::Held held(turn_);
  const SdoConnection* const found = connections_.find(client, server);
  if (found == nullptr) co_return fail(Errc::not_found, "there is no such SDO connection");
  const SdoConnection connection = *found;
  co_await take_back(connection);
  co_return Result<void>{};
}

// The client first, so that it does not ask a server that no longer listens.
rt::Task<void> SdoManager::take_back(SdoConnection connection) {
  const ChannelEnd client = client_end(connection);
  const ChannelEnd server = server_end(connection);
  co_await clear_end(client);
  co_await clear_end(server);
  connections_.remove(connection.client, connection.server);
  connections_.put_back(connection.ids);
  tell();
}

// The node was lost, it booted, or it is heard again.
rt::Task<void> SdoManager::look_at(NodeId node, bool lost) {
  const std::vector<SdoConnection> all(connections_.all().begin(), connections_.all().end());
  for (const auto& each : all) {
    const SdoConnection connection = each;
    const bool serves = connection.server == node;
    if (!serves && connection.client != node) continue;
    bool stays = false;
    if (serves && !lost) {
      const auto end = co_await read_end(node, connection.server_object);
      stays = end && end->valid && end->ids == connection.ids;
      if (end && !stays) {
        const auto written = co_await write_end(server_end(connection));
        stays = written.has_value();
      }
    }
    if (!stays) co_await take_back(connection);
  }
  const bool to_be_read = !lost && (connections_.holds(node) || unread_.test(node.value()));
  if (to_be_read) co_await clean(node);
}

}  // namespace berth::manager
