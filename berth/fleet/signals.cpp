#include "berth/fleet/signals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "berth/command/objects.hpp"
#include "berth/document/bus_signals.hpp"
#include "berth/od/data_type.hpp"
#include "berth/od/notation.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/text/quantity.hpp"

namespace berth::fleet {
namespace {

using namespace std::chrono_literals;
using sparkplug::DataType;
using sparkplug::Value;

struct Position {
  std::uint32_t key = 0;
  unsigned at = 0;
  unsigned bits = 0;
  rt::Duration timer{};
};

std::optional<Position> position_in(const od::PdoParameters& pdo, ObjectRef object) {
  unsigned at = 0;
  for (const auto& entry : pdo.entries) {
    if (entry.bits == 0 || at + entry.bits > od::most_pdo_bits) break;
    if (entry.object == object) return Position{pdo.cob_id.key(), at, entry.bits, std::chrono::milliseconds(pdo.timer)};
    at += entry.bits;
  }
  return std::nullopt;
}

// What the device sends comes first: in an RPDO is what others tell it.
std::optional<Position> position_of(const od::Values& values, ObjectRef object) {
  std::optional<Position> found;
  for (const auto kind : {od::PdoKind::tpdo, od::PdoKind::rpdo}) {
    od::for_each_communication(values.description(), kind, [&](unsigned number) {
      if (found) return;
      const auto pdo = od::read_pdo(values, kind, number);
      if (pdo.cob_id.valid() && !pdo.is_mpdo()) found = position_in(pdo, object);
    });
  }
  return found;
}

bool is_text(od::DataType type) noexcept { return type == od::DataType::visible_string; }

class Planner {
 public:
  Planner(const design::Machine& machine, const traffic::LinkPlan* links) : machine_(machine) {
    const auto publishes = [](const design::Slot& slot) { return !slot.publish.empty(); };
    if (std::ranges::any_of(machine.slots, publishes)) slots_ = document::configured_slots(machine, links);
  }

  SignalPlan run() {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      for (const auto& wanted : machine_.slots[i].publish) add(i, wanted);
    }
    return std::move(plan_);
  }

 private:
  void add(std::size_t index, const design::Publish& wanted) {
    const auto& spec = machine_.slots[index].spec;
    const auto* const bus = machine_.bus(spec.name.bus);
    Signal signal{.slot = index, .wanted = wanted, .metric = "Signals/" + wanted.object};
    const auto node = command::find_node(machine_, "", spec.name.bus + "/" + spec.name.name);
    const auto object = node ? command::find_object(machine_, *node, wanted.object)
                             : command::Checked<command::KnownObject>(tl::unexpected(node.error()));
    if (!object) return refuse(wanted, object.error(), "name an object of the slot's description, or its number");
    take_object(signal, *object);
    if (wanted.poll) {
      signal.timeout = wanted.timeout.value_or(3 * wanted.every);
    } else if (!place(signal, *bus)) {
      return;
    }
    if (!has_type(signal)) return;
    plan_.signals.push_back(std::move(signal));
  }

  void take_object(Signal& signal, const command::KnownObject& object) {
    signal.object = object.ref;
    signal.type = object.type;
    signal.type_is_described = object.type_is_described();
    const auto& notes = slots_[signal.slot].notes;
    if (!notes) return;
    const od::Meaning meaning = command::meaning_of(notes->of(object.ref), object.type);
    signal.unit = meaning.unit;
    if (od::is_integer(object.type) && object.type != od::DataType::boolean)
      signal.factor = static_cast<double>(meaning.number) * std::pow(10.0, meaning.exponent);
  }

  // False: refused.
  bool place(Signal& signal, const design::Bus& bus) {
    const auto& wanted = signal.wanted;
    const auto own = std::ranges::find(machine_.buses, bus.name, &design::Bus::name);
    const char* const poll = "write poll = true: Berth then reads it by SDO, which costs bus time";
    if (own == machine_.buses.end()) {
      refuse(wanted, fmt::format("Berth does not hear the PDOs of bus {}, which is beneath a gateway", bus.name), poll);
      return false;
    }
    const auto& values = slots_[signal.slot].values;
    if (!values) {
      refuse(wanted, "the slot has no description, so its PDOs are not known", "write eds = \"…\"");
      return false;
    }
    const auto found = position_of(*values, signal.object);
    if (!found) {
      refuse(wanted,
             fmt::format("no PDO of slot {} carries {}", text::quoted(machine_.slots[signal.slot].spec.name.name),
                         od::write_object(signal.object)),
             fmt::format("map it (config =, a link), or {}", poll));
      return false;
    }
    signal.bus = static_cast<std::size_t>(own - machine_.buses.begin());
    signal.key = found->key;
    signal.at = static_cast<std::uint8_t>(found->at);
    signal.bits = static_cast<std::uint8_t>(found->bits);
    constexpr int missed = 3;
    const rt::Duration by_timer = found->timer.count() > 0 ? std::max<rt::Duration>(missed * found->timer, 1s) : 0ns;
    signal.timeout = wanted.timeout.value_or(by_timer);
    return true;
  }

  bool has_type(const Signal& signal) {
    const bool number = od::bit_length(signal.type) != 0 && !od::is_time(signal.type);
    const bool unknown = signal.type == od::DataType::none;
    if (number || (signal.polled() ? is_text(signal.type) : unknown)) return true;
    refuse(signal.wanted,
           unknown ? "its data type is not known" : fmt::format("{} is not published", od::name(signal.type)),
           "publish a number, a BOOLEAN, or by poll = true a VISIBLE_STRING");
    return false;
  }

  void refuse(const design::Publish& wanted, std::string why, std::string fix) {
    plan_.findings.push_back({Finding::Severity::error, machine_.file, wanted.place.line, wanted.place.column,
                              "publish " + text::quoted(wanted.object), std::move(why), std::move(fix)});
  }

  const design::Machine& machine_;
  std::vector<document::DescribedSlot> slots_;
  SignalPlan plan_;
};

// Bit 0 of byte 0 is bit 0 (CiA 301 §7.1.4). Bytes beyond the frame's size are anything.
std::uint64_t first_eight(const can::Frame& frame) noexcept {
  std::uint64_t all = 0;
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(&all, frame.data.data(), sizeof all);
  } else {
    for (unsigned i = 0; i < sizeof all; ++i) all |= std::uint64_t{frame.data[i]} << (8U * i);
  }
  return all;
}

DataType integer_type(od::DataType type) noexcept {
  const unsigned bytes = od::byte_size(type) <= 2   ? static_cast<unsigned>(od::byte_size(type))
                         : od::byte_size(type) <= 4 ? 4U
                                                    : 8U;
  const bool is_signed = od::is_signed(type);
  switch (bytes) {
    case 1: return is_signed ? DataType::int8 : DataType::uint8;
    case 2: return is_signed ? DataType::int16 : DataType::uint16;
    case 4: return is_signed ? DataType::int32 : DataType::uint32;
    default: return is_signed ? DataType::int64 : DataType::uint64;
  }
}

}  // namespace

DataType Signal::data_type() const noexcept {
  if (factor != 1) return DataType::float64;
  switch (type) {
    case od::DataType::none: return DataType::uint64;
    case od::DataType::boolean: return DataType::boolean;
    case od::DataType::real32: return DataType::float32;
    case od::DataType::real64: return DataType::float64;
    case od::DataType::visible_string: return DataType::string;
    default: return integer_type(type);
  }
}

double Signal::number(std::uint64_t raw) const noexcept {
  if (type == od::DataType::real32) return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
  if (type == od::DataType::real64) return std::bit_cast<double>(raw);
  if (od::is_signed(type)) return static_cast<double>(static_cast<std::int64_t>(raw)) * factor;
  return static_cast<double>(raw) * factor;
}

Value Signal::value(std::uint64_t raw) const {
  switch (data_type()) {
    case DataType::float64: return number(raw);
    case DataType::float32: return static_cast<float>(number(raw));
    case DataType::boolean: return raw != 0;
    case DataType::int8:
    case DataType::int16:
    case DataType::int32:
    case DataType::int64: return static_cast<std::int64_t>(raw);
    default: return raw;
  }
}

std::optional<std::string> Signal::text_for(const Value& value) const {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "1" : "0";
  if (const auto* whole = std::get_if<std::int64_t>(&value)) return fmt::format("{}", *whole);
  if (const auto* whole = std::get_if<std::uint64_t>(&value)) return fmt::format("{}", *whole);
  const auto* const single = std::get_if<float>(&value);
  const auto* const wide = std::get_if<double>(&value);
  if (single == nullptr && wide == nullptr) return std::nullopt;
  const double given = wide != nullptr ? *wide : static_cast<double>(*single);
  if (!std::isfinite(given)) return std::nullopt;
  if (factor == 1) return single != nullptr ? fmt::format("{}", *single) : fmt::format("{}", given);
  const double counts = std::round(given / factor);
  constexpr double most = 9.0e18;
  if (std::abs(counts) > most) return std::nullopt;
  return fmt::format("{}", static_cast<std::int64_t>(counts));
}

SignalPlan plan_signals(const design::Machine& machine, const traffic::LinkPlan* links) {
  return Planner(machine, links).run();
}

SignalTable::SignalTable(const std::vector<Signal>& signals, std::size_t buses)
    : buses_(buses), states_(signals.size()) {
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < signals.size(); ++i) {
    if (!signals[i].polled()) order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return std::pair(signals[i].bus, signals[i].key); });
  for (auto& bus : buses_) bus.base.resize(can::base_mask + 1);
  for (const auto i : order) {
    const Signal& signal = signals[i];
    auto& bus = buses_[signal.bus];
    Range& range = (signal.key & can::extended_flag) != 0 ? bus.extended[signal.key] : bus.base[signal.key];
    if (range.count == 0) range.first = static_cast<std::uint32_t>(parts_.size());
    ++range.count;
    parts_.push_back({i, signal.at, signal.bits, signal.type});
  }
}

void SignalTable::frame(std::size_t bus, const can::Frame& frame, rt::Time at) noexcept {
  BusTable& table = buses_[bus];
  // The bits without stuff bits and the gap, and one stuff bit for sixteen that may be stuffed: what random data has.
  const unsigned data = frame.remote ? 0U : 8U * frame.size;
  const unsigned head = frame.extended ? 54U : 34U;
  table.bits += head + 13U + data + (head + data) / 16U;
  if (frame.remote || frame.size > 8) return;
  if (!frame.extended) return hear(table.base[frame.id & can::base_mask], frame, at);
  if (table.extended.empty()) return;
  const auto found = table.extended.find(frame.key());
  if (found != table.extended.end()) hear(found->second, frame, at);
}

void SignalTable::hear(const Range& range, const can::Frame& frame, rt::Time at) noexcept {
  if (range.count == 0) return;
  const std::uint64_t all = first_eight(frame);
  for (std::uint32_t i = 0; i < range.count; ++i) {
    const Part& part = parts_[range.first + i];
    if (part.at + part.bits > 8U * frame.size) continue;  // a shorter PDO than it should be
    const std::uint64_t mask = part.bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << part.bits) - 1;
    std::uint64_t raw = all >> part.at & mask;
    const bool negative = od::is_signed(part.type) && (raw >> (part.bits - 1U) & 1U) != 0;
    if (negative) raw |= ~mask;
    State& state = states_[part.signal];
    state.raw = raw;
    state.at = at;
    state.known = true;
  }
}

std::uint64_t SignalTable::take_bits(std::size_t bus) noexcept { return std::exchange(buses_[bus].bits, 0); }

}  // namespace berth::fleet
