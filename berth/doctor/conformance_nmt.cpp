// NMT, error control and SYNC on the bus: CiA 301 §7.3.2, §7.2.8, §7.2.5. Everything here changes the device.
#include <fmt/format.h>

#include "berth/co/nmt.hpp"
#include "berth/doctor/conformance_parts.hpp"

namespace berth::doctor {
namespace {

constexpr std::string_view machine = "7.3.2.2", heartbeats = "7.2.8.3.2.2", guards = "7.2.8.3.2.1",
                           boot_up = "7.2.8.3.3", counter = "7.2.5.3.1";
constexpr std::uint8_t start = 0x01, stop = 0x02, pre_operational = 0x80, reset_node = 0x81, reset_communication = 0x82;
constexpr std::uint8_t operational_state = 0x05, stopped_state = 0x04, pre_operational_state = 0x7F;
constexpr auto beat = std::chrono::milliseconds(50);
constexpr std::uint16_t beat_ms = 50;

std::string shown(const std::optional<can::Frame>& frame) { return frame ? can::to_string(*frame) : "silence"; }

}  // namespace

rt::Task<void> NmtChecks::run() {
  const bool tells = described_.settable(0x1017, 0, 2);
  if (!tells) report_.skip(machine, {}, "the NMT states", "1017h is not described as rw: the states cannot be heard");
  const bool booted = co_await reset(reset_node);
  report_.holds(boot_up, {}, "reset node ends with one boot-up message of one byte", booted, "it did not come");
  if (!booted) co_return;
  co_await resets();
  if (tells) co_await states();
  if (tells) co_await heartbeat();
  if (described_.has(0x100C)) co_await guarding();
  co_await sync_counter();
  co_await reset(reset_node);
}

rt::Task<void> NmtChecks::command(std::uint8_t command, std::uint8_t node, unsigned size) {
  can::Frame frame;
  frame.id = co::nmt_command_id;
  frame.size = static_cast<std::uint8_t>(size);
  frame.data = {command, node};
  device_.forget();
  device_.send(frame);
  const rt::Duration pause = std::chrono::milliseconds(5);
  co_await rt::sleep_for(pause);
}

rt::Task<bool> NmtChecks::reset(std::uint8_t which) {
  co_await command(which, options_.node.value(), 2);
  const auto until = device_.now() + options_.boot;
  while (device_.now() < until && device_.reachable()) {
    const rt::Duration rest = until - device_.now();
    const auto heard = co_await device_.hear(co::error_control_id(options_.node), rest);
    if (!heard) co_return false;
    if (heard->size == 1 && heard->data[0] == 0) co_return true;
  }
  co_return false;
}

// The effect of resets on values by §7.3.2.2 (initialisation): reset communication restores 1000h to 1FFFh, reset node
// everything.
rt::Task<void> NmtChecks::resets() {
  ObjectRef where{};
  const auto* const application = application_object(where);
  const auto base = co_await device_.read(0x1017, 0);
  AccessResult own;
  if (application != nullptr) own = co_await device_.read(where.index, where.sub);
  for (const std::uint8_t which : std::array<std::uint8_t, 2>{reset_communication, reset_node}) {
    const bool all = which == reset_node;
    Bytes other = own.bytes;
    if (!other.empty()) other[0] ^= 1U;
    bool changed = false;
    if (application != nullptr) {
      const auto done = co_await device_.write(where.index, where.sub, other);
      changed = done.good();
    }
    if (described_.settable(0x1017, 0, 2)) co_await device_.write_number(0x1017, 0, 2, base.number() ^ 0x4000U);
    const bool booted = co_await reset(which);
    report_.holds(boot_up, {}, all ? "reset node: boot-up" : "reset communication: boot-up", booted, "it did not come");
    const auto period = co_await device_.read(0x1017, 0);
    if (base.good()) {
      report_.holds(machine, {0x1017, 0},
                    all ? "reset node brings back its value" : "reset communication brings it back",
                    period.bytes == base.bytes, fmt::format("{} instead of {}", period.number(), base.number()));
    }
    if (!changed) continue;
    const auto value = co_await device_.read(where.index, where.sub);
    if (all) {
      report_.holds(machine, where, "reset node brings back its value", value.bytes == own.bytes, value.words());
    } else {
      report_.holds(machine, where, "reset communication leaves it alone", value.bytes == other, value.words());
    }
  }
}

// A plain number that changes only by writes.
const od::SubObject* NmtChecks::application_object(ObjectRef& where) const noexcept {
  if (!options_.description) return nullptr;
  for (const auto& object : options_.description->objects()) {
    if (object.index < 0x2000) continue;
    for (const auto& sub : options_.description->subs(object)) {
      const bool plain = od::is_integer(sub.type) && sub.type != od::DataType::boolean &&
                         sub.access == od::Access::rw && !sub.mappable &&
                         options_.description->limits(sub) == nullptr &&
                         ((object.obj_flags | sub.obj_flags) & od::refuse_write_on_download) == 0;
      if (!plain || (object.count > 1 && sub.sub == 0)) continue;
      where = {object.index, sub.sub};
      return &sub;
    }
  }
  return nullptr;
}

rt::Task<void> NmtChecks::in_state(std::uint8_t state, const char* what) {
  const auto key = co::error_control_id(options_.node);
  device_.forget();
  const rt::Duration patience = 4 * beat;
  const auto heard = co_await device_.hear(key, patience);
  report_.holds(machine, {}, what, heard && heard->size == 1 && heard->data[0] == state, shown(heard));
}

rt::Task<void> NmtChecks::states() {
  const auto own = options_.node.value();
  const auto other = static_cast<std::uint8_t>(own == 1 ? 2 : 1);
  co_await device_.write_number(0x1017, 0, 2, beat_ms);
  co_await command(pre_operational, own, 2);
  co_await in_state(pre_operational_state, "enter pre-operational");
  co_await command(start, own, 2);
  co_await in_state(operational_state, "start: operational");
  const auto in_operational = co_await device_.read(0x1000, 0);
  report_.granted(machine, {0x1000, 0}, "SDO works in operational", in_operational);
  co_await command(stop, own, 2);
  co_await in_state(stopped_state, "stop: stopped");
  const auto in_stopped = co_await device_.raw(device_.request(0x40, 0x1000, 0));
  report_.silent(machine, "SDO is not answered in stopped", in_stopped);
  co_await command(0x03, own, 2);
  co_await in_state(stopped_state, "an unknown command changes nothing");
  co_await command(start, other, 2);
  co_await in_state(stopped_state, "a command to another node changes nothing");
  co_await command(start, own, 1);
  co_await in_state(stopped_state, "a command of one byte changes nothing");
  co_await command(start, own, 3);
  co_await in_state(stopped_state, "a command of three bytes changes nothing");
  co_await command(start, 0, 2);
  co_await in_state(operational_state, "node-ID 0 means every node");
  co_await command(pre_operational, own, 2);
  co_await in_state(pre_operational_state, "from operational to pre-operational");
  const auto again = co_await device_.read(0x1000, 0);
  report_.granted(machine, {0x1000, 0}, "SDO works in pre-operational", again);
}

rt::Task<void> NmtChecks::heartbeat() {
  const auto key = co::error_control_id(options_.node);
  co_await device_.write_number(0x1017, 0, 2, beat_ms);
  device_.forget();
  std::optional<rt::Time> last;
  for (unsigned i = 0; i < 4; ++i) {
    const rt::Duration patience = 4 * beat;
    const auto heard = co_await device_.hear(key, patience);
    if (!heard) {
      report_.holds(heartbeats, {0x1017, 0}, "a heartbeat comes", false, "silence");
      co_return;
    }
    const auto gap = last ? device_.heard_at() - *last : rt::Duration(beat);
    last = device_.heard_at();
    const bool in_time = gap >= beat * 4 / 5 && gap <= beat * 6 / 5;
    report_.holds(heartbeats, {0x1017, 0}, "heartbeats come every 50 ms, one byte, bit 7 is 0",
                  in_time && heard->size == 1 && heard->data[0] < 0x80, shown(heard));
  }
  co_await device_.write_number(0x1017, 0, 2, 0);
  device_.forget();
  const rt::Duration silence = 4 * beat;
  const auto after = co_await device_.hear(key, silence);
  report_.silent(heartbeats, "0 ends the heartbeat", after);
}

rt::Task<void> NmtChecks::guarding() {
  if (described_.settable(0x1017, 0, 2)) co_await device_.write_number(0x1017, 0, 2, 0);
  const bool anew = co_await reset(reset_communication);
  if (!anew) co_return;
  if (described_.settable(0x1017, 0, 2)) co_await device_.write_number(0x1017, 0, 2, 0);
  const auto key = co::error_control_id(options_.node);
  can::Frame question;
  question.id = key;
  question.remote = true;
  question.size = 1;
  for (unsigned i = 0; i < 3; ++i) {
    device_.forget();
    device_.send(question);
    const auto answer = co_await device_.hear(key, options_.timeout);
    const std::uint8_t toggle = i % 2 == 0 ? 0x00 : 0x80;
    const bool good = answer && answer->size == 1 && (answer->data[0] & 0x80U) == toggle;
    report_.holds(guards, {0x100C, 0}, "guarding is answered, the toggle bit begins with 0 and alternates", good,
                  shown(answer));
  }
}

rt::Task<void> NmtChecks::sync_counter() {
  const bool all =
      described_.settable(0x1005, 0, 4) && described_.settable(0x1006, 0, 4) && described_.settable(0x1019, 0, 1);
  const auto now = co_await device_.read(0x1005, 0);
  if (!all || now.number() != co::sync_id) {
    report_.skip(counter, {0x1019, 0}, "the SYNC counter",
                 "1005h, 1006h or 1019h is not described as rw, or SYNC has another id");
    co_return;
  }
  co_await device_.write_number(0x1006, 0, 4, 0);
  co_await device_.write_number(0x1019, 0, 1, 3);
  co_await device_.write_number(0x1006, 0, 4, 20'000);
  for (unsigned round = 0; round < 2; ++round) {
    const auto produces = co_await device_.write_number(0x1005, 0, 4, co::sync_id | co::CobId::second_bit);
    if (!produces.good()) {
      report_.skip(counter, {0x1005, 0}, "the SYNC counter", "the device makes no SYNC");
      break;
    }
    device_.forget();
    for (const unsigned want : std::array<unsigned, 5>{1, 2, 3, 1, 2}) {
      const rt::Duration patience = std::chrono::milliseconds(100);
      const auto heard = co_await device_.hear(co::sync_id, patience);
      report_.holds(counter, {0x1019, 0}, "the SYNC counter runs from 1 to 1019h, anew when bit 30 is set anew",
                    heard && heard->size == 1 && heard->data[0] == want, shown(heard));
    }
    co_await device_.write_number(0x1005, 0, 4, co::sync_id);
  }
  co_await device_.write_number(0x1006, 0, 4, 0);
  co_await device_.write_number(0x1019, 0, 1, 0);
}

}  // namespace berth::doctor
