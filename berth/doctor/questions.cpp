#include "berth/doctor/questions.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/lss/master.hpp"

namespace berth::doctor {
namespace {

constexpr std::uint32_t top = 0xFFFF'FFFF;

lss::MasterOptions patience(const QuestionOptions& options) {
  lss::MasterOptions m;
  m.service.timeout = options.lss_timeout;
  m.identify.timeout = options.identify_window;
  return m;
}

rt::Task<Result<bool>> anybody(lss::Master& master, const lss::IdentifyRanges& ranges) {
  const auto heard = co_await master.identify_remote(ranges);
  if (!heard) co_return fail(heard.error());
  co_return heard->answers > 0;
}

/// A range still to be examined. `sure`: other answers prove that it contains a device.
struct Open {
  lss::IdentifyRanges ranges;
  bool sure = false;
};

bool single(const lss::IdentifyRanges& r) noexcept {
  return r.serial_low == r.serial_high && r.revision_low == r.revision_high;
}

// Halves the serial number first, then the revision.
std::pair<lss::IdentifyRanges, lss::IdentifyRanges> halves(const lss::IdentifyRanges& whole) noexcept {
  auto lower = whole;
  auto upper = whole;
  if (whole.serial_low != whole.serial_high) {
    lower.serial_high = whole.serial_low + (whole.serial_high - whole.serial_low) / 2;
    upper.serial_low = lower.serial_high + 1;
  } else {
    lower.revision_high = whole.revision_low + (whole.revision_high - whole.revision_low) / 2;
    upper.revision_low = lower.revision_high + 1;
  }
  return {lower, upper};
}

// The devices of one type: a range that answers is halved. If the lower half is silent, the upper one need not be
// asked; but a single address is always asked, so that a lost answer does not invent a device.
rt::Task<Result<void>> enumerate(lss::Master& master, TypeCode type, unsigned most, std::vector<LssAddress>& found) {
  std::vector<Open> open;
  open.push_back({{type.vendor, type.product, 1, top, 0, top}, false});
  open.push_back({{type.vendor, type.product, 0, 0, 0, top}, false});  // the usual revision, separately
  unsigned count = 0;
  while (!open.empty() && count < most) {
    const Open next = open.back();
    const lss::IdentifyRanges ranges = next.ranges;
    open.pop_back();
    bool there = next.sure && !single(ranges);
    if (!there) {
      const auto answered = co_await anybody(master, ranges);
      if (!answered) co_return fail(answered.error());
      there = *answered;
    }
    if (!there) continue;
    if (single(ranges)) {
      found.push_back({type.vendor, type.product, ranges.revision_low, ranges.serial_low});
      ++count;
      continue;
    }
    const auto [lower, upper] = halves(ranges);
    const auto in_lower = co_await anybody(master, lower);
    if (!in_lower) co_return fail(in_lower.error());
    open.push_back({upper, !*in_lower});
    if (*in_lower) open.push_back({lower, true});
  }
  co_return Result<void>();
}

// Reads its active node-ID. All devices are in waiting state before and after.
rt::Task<Result<void>> node_id_of(lss::Master& master, Answers::Present& device) {
  const auto selected = co_await master.switch_selective(device.device);
  if (selected) {
    const auto id = co_await master.inquire_node_id();
    if (id) {
      const auto active = NodeId::make(id->byte());
      device.told = active.has_value() && !id->differ;
      device.active = active.value_or(NodeId());
    }
  }
  const auto quiet = co_await master.switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  co_return Result<void>();
}

/// Counts every answer to one SDO request.
class SdoEar final : private can::Handler {
 public:
  SdoEar(can::Dispatcher& dispatcher, NodeId node, ObjectRef object) : object_(object) {
    dispatcher.add(can::only(0x580U + node.value()), *this);
  }
  [[nodiscard]] unsigned answers() const noexcept { return answers_; }
  [[nodiscard]] const std::vector<std::uint32_t>& values() const noexcept { return values_; }

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (frame.size != 8 || load_le<std::uint16_t>(frame.data.data() + 1) != object_.index ||
        frame.data[3] != object_.sub)
      return;
    ++answers_;
    const auto value = load_le<std::uint32_t>(frame.data.data() + 4);
    const bool expedited = (frame.data[0] & 0xE2U) == 0x42U;
    if (expedited && std::ranges::find(values_, value) == values_.end() && values_.size() < 8) values_.push_back(value);
  }
  ObjectRef object_;
  unsigned answers_ = 0;
  std::vector<std::uint32_t> values_;
};

// All devices that answer an upload of this object under this node-ID (expedited; docs/protocols/cia301.md §SDO).
rt::Task<Result<Answers::Serials>> read_all(can::Dispatcher& dispatcher, NodeId node, ObjectRef object,
                                            rt::Duration window) {
  const SdoEar ear(dispatcher, node, object);
  const auto frame =
      can::Frame::base(0x600U + node.value(), {0x40, static_cast<std::uint8_t>(object.index & 0xFFU),
                                               static_cast<std::uint8_t>(object.index >> 8U), object.sub, 0, 0, 0, 0});
  if (dispatcher.send(frame) != can::Queued::yes) co_return fail(Errc::bus, "the question could not be sent");
  co_await rt::sleep_for(window);
  Answers::Serials told;
  told.node = node;
  told.answers = ear.answers();
  told.values = ear.values();
  co_return told;
}

rt::Task<Result<void>> ask_node(can::Dispatcher& dispatcher, NodeId node, const QuestionOptions& options,
                                Answers& answers) {
  const ObjectRef serial{0x1018, 4};
  const auto told = co_await read_all(dispatcher, node, serial, options.sdo_timeout);
  if (!told) co_return fail(told.error());
  if (told->answers == 0) co_return Result<void>();
  answers.serials.push_back(*told);
  for (std::uint16_t index = 0x1800; index <= 0x1803; ++index) {
    const ObjectRef cob_id{index, 1};
    const auto pdo = co_await read_all(dispatcher, node, cob_id, options.sdo_timeout);
    if (!pdo) co_return fail(pdo.error());
    for (const auto value : pdo->values) {
      if ((value & 0x8000'0000U) != 0) continue;  // not valid
      const bool extended = (value & 0x2000'0000U) != 0;
      const auto key = extended ? (value & can::extended_mask) | can::extended_flag : value & can::base_mask;
      answers.claims.push_back({node, index, key});
    }
    if (pdo->values.empty()) break;
  }
  co_return Result<void>();
}

std::vector<TypeCode> types_of(const Expected& expected) {
  std::vector<TypeCode> types;
  for (const auto& slot : expected.slots) {
    if (std::ranges::find(types, slot.type) == types.end()) types.push_back(slot.type);
  }
  return types;
}

}  // namespace

rt::Task<Result<void>> ask(can::Dispatcher& dispatcher, Ear& ear, const Expected& expected,
                           const QuestionOptions& options, Answers& answers) {
  const auto master_options = patience(options);
  lss::Master master(dispatcher, master_options);
  const auto blank = co_await master.identify_non_configured();
  if (!blank) co_return fail(blank.error());
  answers.asked = true;
  answers.blank = blank->answers > 0;
  const auto types = types_of(expected);
  for (const TypeCode type : types) {
    std::vector<LssAddress> found;
    const auto done = co_await enumerate(master, type, options.most_devices, found);
    if (!done) co_return fail(done.error());
    for (const auto& device : found) answers.present.push_back({device, NodeId(), false});
  }
  answers.selective = ear.heard().lss_requests.count == 0;
  if (answers.selective) {
    const auto quiet = co_await master.switch_global(lss::State::waiting);
    if (!quiet) co_return fail(quiet.error());
    for (auto& device : answers.present) {
      const auto done = co_await node_id_of(master, device);
      if (!done) co_return fail(done.error());
    }
  }
  if (!options.intrusive) co_return Result<void>();
  answers.intrusive = true;
  for (unsigned n = 1; n <= 127; ++n) {
    const NodeId node(static_cast<std::uint8_t>(n));
    if (signs_of(ear.heard().node(node), expected.predefined_pdos).count == 0 && expected.slot(node) == nullptr)
      continue;
    const auto done = co_await ask_node(dispatcher, node, options, answers);
    if (!done) co_return fail(done.error());
  }
  co_return Result<void>();
}

}  // namespace berth::doctor
