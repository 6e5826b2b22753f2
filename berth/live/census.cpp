#include "berth/live/census.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/co/nmt.hpp"
#include "berth/od/cia302.hpp"

namespace berth::live {

namespace {

constexpr can::IdRange every_base_frame{0, can::base_mask};
constexpr std::size_t gaps_kept = 16;
constexpr std::size_t longest_number = 8;  // perhaps of another size than in the standard
constexpr std::size_t longest_text = 256;  // 1008h to 100Ah

rt::Duration median(std::vector<rt::Duration> gaps) {
  if (gaps.empty()) return rt::Duration{0};
  const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::ranges::nth_element(gaps, middle);
  return *middle;
}

// Keeps printable characters; the rest of a name that a device gives is left out.
std::string printable(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const auto byte : bytes) {
    if (byte == 0) break;
    if (byte >= 0x20 && byte < 0x7F) text.push_back(static_cast<char>(byte));
  }
  const auto last = text.find_last_not_of(' ');
  return last == std::string::npos ? std::string() : text.substr(0, std::min<std::size_t>(last + 1, 64));
}

}  // namespace

Census::Census(can::Dispatcher& dispatcher) : dispatcher_(&dispatcher), sdo_(dispatcher) {
  for (std::size_t id = 1; id < nodes_.size(); ++id) nodes_[id].seen.id = NodeId(static_cast<std::uint8_t>(id));
  dispatcher.add(every_base_frame, *this);
}

// ---- received frames ----

// Own frames never come in, so every SDO request here is another client's.
void Census::received(const can::Frame& frame, rt::Time at) noexcept {
  ++frames_;
  const auto key = frame.key();
  Node& node = nodes_[key & 0x7FU];
  if (key == co::sync_id) {
    if (last_sync_) sync_period_ = at - *last_sync_;
    last_sync_ = at;
  } else if (co::all_error_control.contains(key)) {
    if (frame.remote) {
      node.seen.guarded = node.heard = true;
    } else {
      beat(node, frame, at);
    }
  } else if (co::all_sdo_requests.contains(key) && !frame.remote) {
    node.foreign = at;
    node.seen.foreign_client = true;
  } else if (co::all_emcy.contains(key) || co::all_sdo_responses.contains(key)) {
    node.heard = true;
  }
}

void Census::beat(Node& node, const can::Frame& frame, rt::Time at) {
  if (frame.size == 0) return;
  const auto state = co::nmt_state(frame.data[0]);
  if (!state) return;
  node.heard = true;
  // After its boot-up message a device is pre-operational (CiA 301 §7.3.2.2.2).
  node.seen.state = *state == NmtState::initialising ? NmtState::pre_operational : *state;
  if (*state == NmtState::initialising) {
    node.last_beat.reset();
    return;
  }
  ++node.seen.beats;
  if (node.last_beat) {
    if (node.gaps.size() == gaps_kept) node.gaps.erase(node.gaps.begin());
    node.gaps.push_back(at - *node.last_beat);
  }
  node.last_beat = at;
}

std::vector<NodeSeen> Census::nodes() const {
  std::vector<NodeSeen> all;
  for (const auto& node : nodes_) {
    if (!node.heard) continue;
    all.push_back(node.seen);
    if (node.seen.period.count() == 0 && !node.seen.guarded) all.back().period = median(node.gaps);
  }
  return all;
}

// ---- questions ----

bool Census::may_ask(const Node& node, const CensusOptions& options) const noexcept {
  return !node.foreign || dispatcher_->executor().now() - *node.foreign > options.client_gone;
}

rt::Task<Result<void>> Census::ask(CensusOptions options) {
  for (std::uint8_t id = 1; id < 128; ++id) {
    Node& node = nodes_[id];
    const bool wanted = node.heard || options.everybody;
    const bool known = std::ranges::find(options.known, NodeId(id)) != options.known.end();
    if (!wanted || known || NodeId(id) == options.own) continue;
    if (!may_ask(node, options)) {
      node.seen.problem = "another SDO client talks to it";
      continue;
    }
    if (options.masters_only) {
      const auto told = co_await ask_stranger(NodeId(id), options);
      if (!told) co_return fail(told.error());
      continue;
    }
    const auto asked = co_await ask_node(NodeId(id), options);
    if (!asked) co_return fail(asked.error());
  }
  co_return Result<void>();
}

rt::Task<Result<co::SdoValue>> Census::upload(NodeId id, ObjectRef ref, std::size_t most, CensusOptions options) {
  Node& node = nodes_[id.value()];
  co_await rt::sleep_for(options.pause);
  if (!may_ask(node, options)) co_return fail(Errc::cancelled, "another SDO client talks to it");
  co::SdoOptions sdo;
  sdo.timeout = options.sdo_timeout;
  sdo.abort_on_timeout = false;  // it would end another client's transfer
  sdo.longest = most;
  const rt::Time began = dispatcher_->executor().now();
  auto value = co_await sdo_.upload(id, ref.index, ref.sub, sdo);
  const bool mixed = node.foreign && *node.foreign >= began;
  if (mixed) co_return fail(Errc::cancelled, "another SDO client talks to it");
  co_return value;
}

// Empty: the device has no such object, or one of another `size` than in the standard.
rt::Task<Result<std::optional<std::uint32_t>>> Census::number(NodeId id, ObjectRef ref, std::size_t size,
                                                              CensusOptions options) {
  const auto value = co_await upload(id, ref, longest_number, options);
  if (!value) {
    if (value.error().code != Errc::aborted) co_return fail(value.error());
    co_return std::optional<std::uint32_t>();
  }
  const auto bytes = value->bytes();
  if (bytes.size() != size) co_return std::optional<std::uint32_t>();
  std::array<std::uint8_t, 4> whole{};
  std::ranges::copy(bytes, whole.begin());
  co_return std::optional<std::uint32_t>(load_le<std::uint32_t>(whole.data()));
}

rt::Task<Result<std::string>> Census::text(NodeId id, std::uint16_t index, CensusOptions options) {
  const ObjectRef ref{index, 0};
  const auto value = co_await upload(id, ref, longest_text, options);
  if (!value) {
    if (value.error().code != Errc::aborted) co_return fail(value.error());
    co_return std::string();
  }
  co_return printable(value->bytes());
}

// A heard period has the jitter of two computers; the device knows the exact one (CiA 301, object 1017h).
rt::Task<Result<void>> Census::ask_period(Node& node, CensusOptions options) {
  const ObjectRef period_object{0x1017, 0};
  const auto told = co_await number(node.seen.id, period_object, 2, options);
  if (!told) co_return fail(told.error());
  node.seen.period = std::chrono::milliseconds(told->value_or(0));
  co_return Result<void>();
}

// A master may send only its heartbeat: then only its objects show what it is (CiA 302-2: 1F80h bit 0, 1F81h).
rt::Task<Result<void>> Census::ask_whether_master(Node& node, CensusOptions options) {
  const ObjectRef startup_object{od::cia302::nmt_startup, 0};
  const auto startup = co_await number(node.seen.id, startup_object, 4, options);
  if (!startup) co_return fail(startup.error());
  node.seen.nmt_master = (startup->value_or(0) & 1U) != 0;
  if (!node.seen.nmt_master) co_return Result<void>();
  const ObjectRef list_object{od::cia302::slave_assignment, 0};
  const auto list = co_await number(node.seen.id, list_object, 1, options);
  if (!list) co_return fail(list.error());
  if (*list) node.seen.network_list = static_cast<std::uint8_t>(**list);
  co_return Result<void>();
}

// Vendor-ID and product code. A part that the device does not report stays unknown.
rt::Task<void> Census::ask_type(Node& node, CensusOptions options) {
  const NodeId id = node.seen.id;
  std::array<std::optional<std::uint32_t>, 2> parts{};
  for (std::uint8_t sub = 1; sub <= 2; ++sub) {
    const ObjectRef ref{0x1018, sub};
    const auto part = co_await number(id, ref, 4, options);
    if (!part) co_return;
    parts[sub - 1U] = *part;
  }
  Identity who(parts[0].value_or(0), parts[1].value_or(0), 0, 0);
  who.unknown = static_cast<std::uint8_t>(0x0CU | (parts[0] ? 0U : 1U) | (parts[1] ? 0U : 2U));
  node.seen.identity = who.with(id);
}

rt::Task<Result<void>> Census::ask_stranger(NodeId id, CensusOptions options) {
  Node& node = nodes_[id.value()];
  const auto master = co_await ask_whether_master(node, options);
  if (!master) {
    if (master.error().code == Errc::bus) co_return fail(master.error());
    node.seen.problem = master.error().code == Errc::timeout ? "no answer to SDO" : describe(master.error());
    co_return Result<void>();
  }
  if (!node.seen.nmt_master) {
    if (options.types) co_await ask_type(node, options);
    co_return Result<void>();
  }
  const ObjectRef type_object{0x1000, 0};
  const auto type = co_await number(id, type_object, 4, options);
  if (!type && type.error().code == Errc::bus) co_return fail(type.error());
  if (type) node.seen.device_type = *type;
  co_return Result<void>();
}

// Skips a device that does not answer, or that another client uses; only a port that takes no frame is an error.
rt::Task<Result<void>> Census::ask_node(NodeId id, CensusOptions options) {
  Node& node = nodes_[id.value()];
  const ObjectRef type_object{0x1000, 0};
  const auto type = co_await number(id, type_object, 4, options);
  if (!type) {
    if (type.error().code == Errc::bus) co_return fail(type.error());
    const bool silent = type.error().code == Errc::timeout;
    if (node.heard) node.seen.problem = silent ? "no answer to SDO" : describe(type.error());
    co_return Result<void>();
  }
  node.heard = true;
  node.seen.device_type = *type;
  std::array<std::uint32_t, 4> parts{};
  std::uint8_t unknown = 0;
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    const ObjectRef ref{0x1018, sub};
    const auto part = co_await number(id, ref, 4, options);
    if (!part) {
      node.seen.problem = describe(part.error());
      co_return Result<void>();
    }
    if (!*part) unknown = static_cast<std::uint8_t>(unknown | 1U << (sub - 1U));
    parts[sub - 1U] = part->value_or(0);
  }
  Identity who(parts[0], parts[1], parts[2], parts[3]);
  who.unknown = unknown;
  node.seen.identity = who.with(id);
  if (unknown == Identity::all_unknown) node.seen.problem = "it has no identity object 1018h";
  const auto period = co_await ask_period(node, options);
  if (!period) co_return Result<void>();
  const auto master = co_await ask_whether_master(node, options);
  if (!master) co_return Result<void>();
  const std::array<std::pair<std::uint16_t, std::string*>, 3> texts{
      {{0x1008, &node.seen.name}, {0x1009, &node.seen.hardware}, {0x100A, &node.seen.software}}};
  for (const auto& [index, into] : texts) {
    auto told = co_await text(id, index, options);
    if (!told) break;
    *into = std::move(*told);
  }
  co_return Result<void>();
}

}  // namespace berth::live
