#include "berth/multilevel/gateway_access.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace berth::multilevel {
namespace {

constexpr std::uint8_t upload = 0x40;
constexpr std::uint8_t segmented_download = 0x20;
constexpr std::uint8_t block_download = 0xC4;  // with CRC
constexpr auto no_node = static_cast<std::uint32_t>(od::AbortCode::device_state);
constexpr unsigned most_again = 3;  // each time, another gateway that was reset may be found on the way
constexpr auto no_answer = static_cast<std::uint32_t>(od::AbortCode::timeout);
constexpr auto no_data = static_cast<std::uint32_t>(od::AbortCode::no_data);
constexpr const char* gateway_silent = "no answer of the gateway";
constexpr const char* no_gateway = "no gateway to that bus: it has no object for it (5F30h to 5F4Fh)";

// For an access that the gateway answers by itself. A gateway beneath another also seems silent while the upper one
// waits without success. A node without the objects is another device.
Result<void> by_itself(Result<void> done) noexcept {
  if (done) return done;
  Error& error = done.error();
  const auto code = static_cast<od::AbortCode>(error.detail);
  const bool missing = code == od::AbortCode::no_object || code == od::AbortCode::no_sub_index;
  if (error.code == Errc::timeout) error.text = gateway_silent;
  if (error.code == Errc::aborted && missing) {
    error.code = Errc::unsupported;
    error.detail = 0;
    error.text = no_gateway;
  }
  return done;
}

}  // namespace

// ---- one access ----

Error GatewayAccess::about(const Error& error, ObjectRef object) const noexcept {
  Error told = error;
  if (error.text == no_gateway) return told;  // it is about that node on the way
  told.node = node_.value();
  told.index = object.index;
  told.sub = object.sub;
  if (error.code == Errc::aborted && error.detail == no_answer) {
    told.code = Errc::timeout;
    told.detail = 0;
    told.text = node_silent;
  } else if (error.code == Errc::timeout && error.text != node_silent) {
    told.text = gateway_silent;
  }
  return told;
}

// A gateway on the way was reset, and lost what this client wrote: this gateway, or one beneath it whose abort code
// comes through this one. So no gateway is assumed to know its node-ID any more. Only the access to the node itself is
// repeated, from its beginning; also after a time-out.
bool GatewayAccess::try_again(const Error& error, ObjectRef object, Attempts& made) noexcept {
  const bool aborted = error.code == Errc::aborted;
  const bool lost = aborted && (error.detail == no_node || error.detail == no_data);
  if (lost) line_->selected = NodeId();
  if (SdoGatewayObjects::contain(object)) return false;
  if (lost) return made.lost++ < most_again;
  const bool timed_out = error.code == Errc::timeout || (aborted && error.detail == no_answer);
  return timed_out && made.timeouts++ < retries_;
}

rt::Task<Result<void>> GatewayAccess::select() {
  if (line_->selected == node_) co_return Result<void>();
  line_->selected = NodeId();
  const std::array<std::uint8_t, 1> bytes{node_.value()};
  const std::span<const std::uint8_t> data = bytes;
  const auto done = co_await at_once_->write(objects_.node.index, objects_.node.sub, data);
  if (done) line_->selected = node_;
  co_return by_itself(done);
}

rt::Task<Result<void>> GatewayAccess::command(co::SdoAccess& gateway, std::uint8_t specifier, ObjectRef object) {
  const std::uint32_t value =
      specifier | static_cast<std::uint32_t>(object.index) << 8U | static_cast<std::uint32_t>(object.sub) << 24U;
  const auto done = co_await gateway.write_u32(objects_.command.index, objects_.command.sub, value);
  co_return done;
}

rt::Task<Result<co::SdoValue>> GatewayAccess::fetch(ObjectRef object, std::size_t most) {
  auto done = co_await select();
  if (done) done = co_await command(*at_once_, upload, object);
  done = by_itself(done);
  if (!done) co_return fail(done.error());
  auto value = co_await gateway_->read_up_to(objects_.data.index, objects_.data.sub, most);
  co_return value;
}

rt::Task<Result<co::SdoValue>> GatewayAccess::read(std::uint16_t index, std::uint8_t sub) {
  const auto most = std::numeric_limits<std::size_t>::max();
  auto value = co_await read_up_to(index, sub, most);
  co_return value;
}

rt::Task<Result<co::SdoValue>> GatewayAccess::read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t most) {
  const ObjectRef object{index, sub};
  co_await line_->turn.take();
  const rt::Held held(line_->turn);
  for (Attempts made;;) {
    auto value = co_await fetch(object, most);
    if (value) co_return value;
    if (!try_again(value.error(), object, made)) co_return fail(about(value.error(), object));
  }
}

// The data first, then the command: its answer is the node's.
rt::Task<Result<void>> GatewayAccess::write_short(ObjectRef object, std::span<const std::uint8_t> data) {
  auto done = co_await select();
  if (!done) co_return done;
  done = co_await at_once_->write(objects_.data.index, objects_.data.sub, data);
  if (!done) co_return by_itself(done);
  const auto specifier = static_cast<std::uint8_t>(0x23U | ((4U - data.size()) << 2U));
  done = co_await command(*gateway_, specifier, object);
  co_return done;
}

// The command first, so that the gateway forwards the data as they come: their answer is the node's.
rt::Task<Result<void>> GatewayAccess::write_long(ObjectRef object, std::span<const std::uint8_t> data) {
  auto done = co_await select();
  if (!done) co_return done;
  const std::uint8_t specifier = data.size() >= block_from_ ? block_download : segmented_download;
  done = co_await command(*at_once_, specifier, object);
  if (!done) co_return by_itself(done);
  done = co_await gateway_->write(objects_.data.index, objects_.data.sub, data);
  co_return done;
}

rt::Task<Result<void>> GatewayAccess::write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) {
  const ObjectRef object{index, sub};
  co_await line_->turn.take();
  const rt::Held held(line_->turn);
  const bool is_short = data.size() >= 1 && data.size() <= 4;
  for (Attempts made;;) {
    auto task = is_short ? write_short(object, data) : write_long(object, data);
    const auto done = co_await task;
    if (done) co_return Result<void>();
    if (!try_again(done.error(), object, made)) co_return fail(about(done.error(), object));
  }
}

// ---- all accesses ----

co::SdoAccess& Routes::access(const Path& path) { return reach(path, path.depth()); }

// A gateway waits one timeout for a node beneath it; for a gateway there it waits one for each level beneath itself.
// The path's length tells this client the minimum of levels.
rt::Duration Routes::timeout_at(std::size_t depth) const noexcept {
  if (depth == 0) return options_.timeout;
  const std::size_t waits = depth == 1 ? 1 : std::max(depth, gateways_.levels);
  return options_.timeout + gateways_.timeout * static_cast<int>(waits);
}

co::SdoAccess& Routes::at_once(NodeId gateway) {
  auto& place = at_once_[gateway];
  if (!place) {
    co::SdoOptions options = options_;
    options.retries = 0;
    place = std::make_unique<co::NodeAccess>(*client_, gateway, options);
  }
  return *place;
}

co::SdoAccess& Routes::reach(const Path& path, std::size_t depth) {
  auto& place = accesses_[Key{depth, path}];
  if (place) return *place;
  if (path.gateways.empty()) {
    co::SdoOptions options = options_;
    options.timeout = timeout_at(depth);
    if (depth > 0) options.retries = 0;
    place = std::make_unique<co::NodeAccess>(*client_, path.node, options);
    return *place;
  }
  auto& line = lines_[path.gateways];
  if (!line) line = std::make_unique<GatewayLine>();
  const Hop last = path.gateways.back();
  const Path above{{path.gateways.begin(), path.gateways.end() - 1}, last.gateway};
  co::SdoAccess& gateway = reach(above, depth);
  auto made = std::make_unique<GatewayAccess>(*line, gateway, path.node, last.port);
  made->set_retries(options_.retries);
  if (above.gateways.empty()) made->set_at_once(at_once(above.node));
  return *(accesses_[Key{depth, path}] = std::move(made));
}

void Routes::forget() noexcept {
  for (auto& [hops, line] : lines_) line->selected = NodeId();
}

}  // namespace berth::multilevel
