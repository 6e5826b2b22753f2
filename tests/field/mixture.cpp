#include "tests/field/mixture.hpp"

#include <unistd.h>
#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>

#include <fmt/format.h>

namespace berth::field {
namespace {

using namespace std::chrono_literals;

constexpr const char* bus_name = "field";
constexpr std::uint32_t setting = 0x2100;  // the parameter of kinds with settings

// Fictitious: one vendor for each kind.
std::uint32_t vendor_of(const Kind& variant) {
  return 0x7F00U + static_cast<std::uint32_t>(kind(variant.name) - kinds().data());
}
std::uint32_t product_of(const Kind& kind) { return kind.parts < 2 || !kind.says_product ? 0U : 0x1000U; }
std::uint32_t revision_of(const Kind& kind) { return kind.parts < 3 || !kind.says_product ? 0U : 0x0001'0002U; }

std::string object(const std::string& section, const char* type, const char* access, std::uint32_t value,
                   const std::string& more = {}) {
  return fmt::format(
      "[{}]\nParameterName=Object {}\nObjectType=0x7\nDataType={}\nAccessType={}\nDefaultValue=0x{:X}\n"
      "PDOMapping=0\n{}\n",
      section, section, type, access, value, more);
}

constexpr const char* u8 = "0x0005";
constexpr const char* u16 = "0x0006";
constexpr const char* u32 = "0x0007";

std::string record(const std::string& index, const char* type, unsigned subs) {
  return fmt::format("[{}]\nParameterName=Record {}\nObjectType={}\nSubNumber={}\n\n", index, index, type, subs + 1) +
         object(index + "sub0", u8, "const", subs);
}

std::string list(const char* section, const std::vector<std::string>& indices) {
  std::string text = fmt::format("[{}]\nSupportedObjects={}\n", section, indices.size());
  for (std::size_t i = 0; i < indices.size(); ++i) text += fmt::format("{}=0x{}\n", i + 1, indices[i]);
  return text + "\n";
}

std::string identity(const Kind& kind) {
  const std::uint32_t values[] = {vendor_of(kind), product_of(kind), revision_of(kind), 0};
  std::string text = record("1018", "0x9", kind.parts);
  for (unsigned part = 0; part < kind.parts; ++part) {
    text += object(fmt::format("1018sub{}", part + 1), u32, "ro", values[part]);
  }
  return text;
}

std::string error_control(const Watched& watched, std::vector<std::string>& indices) {
  std::string text;
  if (watched.guards) {
    text += object("100C", u16, "rw", 0) + object("100D", u8, "rw", 0);
    indices.insert(indices.end(), {"100C", "100D"});
  }
  if (watched.access.empty()) return text;
  std::string limits;
  if (watched.low > 0) limits += fmt::format("LowLimit={}\n", watched.low);
  if (watched.high > 0) limits += fmt::format("HighLimit={}\n", watched.high);
  text += object("1017", u16, std::string(watched.access).c_str(), watched.period, limits);
  indices.emplace_back("1017");
  return text;
}

bool has_address(const Kind& kind) { return kind.from == From::lss; }

}  // namespace

Mixture::Mixture(const Wishes& wishes) : random_(wishes.seed * 0x9E37'79B9U + 7) {
  std::string pattern = (std::filesystem::temp_directory_path() / "berth-field-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no folder for descriptions");
  folder_ = pattern;
  machine_.name = "field";
  design::Bus bus;
  bus.name = bus_name;
  bus.bitrate = rate_for(wishes);
  machine_.buses.push_back(bus);
  plant_.seed = wishes.seed;
  plant_.buses.push_back({bus_name, 0});
  taken_.push_back(bus.master);
  next_serial_ = static_cast<std::uint32_t>(1 + random_.below(0xFFFF'0000U));
  const auto count = static_cast<unsigned>(random_.between(wishes.least, wishes.most));
  draw_kinds(wishes, count);
}

Mixture::~Mixture() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

// Kinds with one bit rate are rare: one bus in four is theirs.
std::uint32_t Mixture::rate_for(const Wishes& wishes) {
  constexpr std::uint32_t rates[] = {20'000, 50'000, 125'000, 125'000, 250'000, 500'000, 1'000'000};
  for (;;) {
    const std::uint32_t rate = rates[random_.below(std::size(rates))];
    const auto is_slow_enough = [&](std::string_view name) {
      const Kind* const k = kind(name);
      return k != nullptr && k->slowest <= rate && rate <= k->quickest;
    };
    // 60 slow devices at 20 kbit/s are minutes of bus time, and tell nothing new.
    const bool big = rate < 125'000 && wishes.most > 20;
    if (!big && std::ranges::all_of(wishes.only, is_slow_enough)) return rate;
  }
}

void Mixture::draw_kinds(const Wishes& wishes, unsigned count) {
  const std::uint32_t rate = machine_.buses.front().bitrate;
  for (unsigned tries = 0; members_.size() < count && tries < 1000; ++tries) {
    const Kind& kind = kinds()[random_.below(kinds().size())];
    const bool wanted = wishes.only.empty() || std::ranges::find(wishes.only, kind.name) != wishes.only.end();
    const auto there = static_cast<unsigned>(
        std::ranges::count_if(members_, [&](const Member& m) { return m.kind->name == kind.name; }));
    if (!wanted || kind.slowest > rate || kind.quickest < rate || there >= kind.most) continue;
    add(vary(kind), wishes);
  }
}

// With and without what makers leave out of one series or another.
const Kind& Mixture::vary(const Kind& kind) {
  using lss::Lackable;
  const auto one_in = [&](unsigned count) { return random_.below(count) == 0; };
  Kind& v = variants_.emplace_back(kind);
  if (one_in(3)) v.emcy = false;
  // Which slot one with LSS gets is not known: what one slot of the kind wants, all devices of the kind need.
  if (v.from != From::lss && one_in(4)) v.settings = false;
  if (one_in(3)) v.watched.low = v.watched.high = 0;
  const bool beats = v.watched.access == "rw";
  if (beats && one_in(3)) v.watched.guards = !v.watched.guards;
  if (beats && v.watched.low == 0 && one_in(3)) v.watched.period = v.watched.period == 0 ? 700 : 0;
  if (one_in(4)) v.response.max = v.response.min;
  if (one_in(4)) v.boot += 500ms;
  const bool plain = v.from == From::lss && !v.lss.habit;
  if (!plain) return v;
  if (one_in(3)) v.lss.short_answers = !v.lss.short_answers;
  for (const auto service : {Lackable::bit_timing, Lackable::activate}) {
    if (one_in(3)) v.lss.without.add(service);
  }
  for (const auto inquiry : {Lackable::inquire_identity, Lackable::inquire_node_id}) {
    if (one_in(5)) v.lss.without.add(inquiry);
  }
  const bool found_otherwise = v.speaks.has(plant::Speaks::fastscan) && v.factory == 0;
  if (found_otherwise && one_in(4)) v.lss.without.add(Lackable::identify);
  return v;
}

NodeId Mixture::free_id() {
  for (;;) {
    const NodeId id(static_cast<std::uint8_t>(1 + random_.below(126)));
    const bool when_new = std::ranges::any_of(kinds(), [&](const Kind& k) { return k.factory == id.value(); });
    if (when_new || std::ranges::find(taken_, id) != taken_.end()) continue;
    taken_.push_back(id);
    return id;
  }
}

void Mixture::add(const Kind& kind, const Wishes& wishes) {
  Member member{.kind = &kind, .id = free_id(), .device = {}, .spare = {}, .wanted = 0};
  member.device = fmt::format("{} {}", kind.name, member.id.value());
  if (wishes.configured && kind.settings) member.wanted = static_cast<std::uint32_t>(1 + random_.below(0xFFFE));
  add_slot(member, wishes);
  plant_.devices.push_back(device(member, false));
  if (wishes.with_spares) {
    member.spare = "new " + member.device;
    plant_.devices.push_back(device(member, true));
  }
  members_.push_back(member);
}

void Mixture::add_slot(const Member& member, const Wishes& wishes) {
  const Kind& kind = *member.kind;
  design::Slot slot;
  slot.spec.name = {machine_.name, bus_name, fmt::format("slot {}", member.id.value())};
  slot.spec.id = member.id;
  slot.spec.type = {vendor_of(kind), product_of(kind)};
  // A product code that the device does not say is not asked for: `type = { vendor = … }`.
  if (kind.parts < 2 || !kind.says_product) slot.spec.asks.unasked = 0b10;
  if (kind.from != From::lss) slot.spec.assign = places::Assign::fixed;
  if (kind.serial == Serial::zero && kind.from == From::lss) {
    slot.spec.when_ambiguous = places::WhenAmbiguous::one_at_a_time;
  }
  if (kind.response.max > 400ms && random_.below(2) == 0) slot.spec.watch.sdo_timeout = 2s;
  if (kind.from == From::object) {
    auto recipe = std::make_shared<places::Recipe>();
    recipe->name = std::string(kind.name);
    recipe->from = {NodeId(kind.factory)};
    recipe->writes = {{0x2000, 0, 1, 0, true}, {0x2002, 0, 1, 1, false}};
    slot.spec.assign = places::Assign::recipe;
    slot.spec.recipe = recipe;
  }
  if (wishes.configured && member.wanted > 0) {
    const std::string text =
        description(kind, member.wanted) + "[DeviceComissioning]\nNodeID=" + std::to_string(member.id.value()) + "\n";
    slot.spec.config = write(fmt::format("slot-{}.dcf", member.id.value()), text);
  }
  machine_.slots.push_back(slot);
}

plant::PlantDevice Mixture::device(const Member& member, bool is_spare) {
  const Kind& kind = *member.kind;
  plant::PlantDevice d;
  d.name = is_spare ? "new " + member.device : member.device;
  d.bus = bus_name;
  d.plugged = !is_spare;
  d.address = {vendor_of(kind), product_of(kind), revision_of(kind), 0};
  if (kind.serial == Serial::own) d.address.serial = next_serial_++;
  if (kind.serial == Serial::lot) d.address.serial = 0x1924;
  d.speaks = kind.speaks;
  d.lss = kind.lss;
  d.response = kind.response;
  d.boot = kind.boot;
  d.storing.time = 50ms;
  set_source(d, member, is_spare);
  if (kind.from == From::object) {
    d.node_id_object = {ObjectRef{0x2000, 0}, plant::PlantSignature{{0x2002, 0}, 1, 1}};
    return d;  // which objects it has says the plant
  }
  d.eds = d.eds_path = write(fmt::format("device-{}.eds", member.id.value()), description(kind, 0));
  if (kind.emcy) {
    d.does.script.file = d.does.script.path =
        write("emcy.lua",
              "device.on_state(function(state)\n"
              "  if state == \"pre-operational\" then device.emcy(0x3100, 5) end\n"
              "end)\n");
  }
  return d;
}

// New devices of a kind come with its factory's node-ID, as long as no other device has it.
void Mixture::set_source(plant::PlantDevice& d, const Member& member, bool is_spare) {
  const Kind& kind = *member.kind;
  const NodeId when_new = kind.factory == 0 ? NodeId() : NodeId(kind.factory);
  switch (kind.from) {
    case From::switches: d.source = plant::NodeIdSource::switches; break;
    case From::connector: d.source = plant::NodeIdSource::connector; break;
    case From::firmware: d.source = plant::NodeIdSource::hard_coded; break;
    case From::object:
    case From::lss: break;
  }
  if (kind.from == From::object) {
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = when_new;
    return;
  }
  if (kind.from != From::lss) {
    d.node_id = member.id;
    return;
  }
  const bool first = std::ranges::none_of(members_, [&](const Member& m) { return m.kind->name == kind.name; });
  if (when_new.configured() && (first || is_spare)) {
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = when_new;
  }
}

std::string Mixture::description(const Kind& kind, std::uint32_t wanted) const {
  std::vector<std::string> optional;
  std::vector<std::string> own;
  std::string objects = object("1000", u32, "ro", kind.device_type) + object("1001", u8, "ro", 0) + identity(kind) +
                        error_control(kind.watched, optional);
  if (kind.emcy) {
    objects += object("1014", u32, "ro", 0x80, "") + record("1003", "0x8", 1) + object("1003sub1", u32, "ro", 0);
    optional.insert(optional.end(), {"1003", "1014"});
  }
  if (kind.settings) {
    objects += record("1010", "0x8", 1) + object("1010sub1", u32, "rw", 1) + record("1011", "0x8", 1) +
               object("1011sub1", u32, "rw", 1);
    objects += object(fmt::format("{:X}", setting), u16, "rw", 0,
                      wanted > 0 ? fmt::format("ParameterValue=0x{:X}\n", wanted) : std::string());
    optional.insert(optional.end(), {"1010", "1011"});
    own.push_back(fmt::format("{:X}", setting));
  }
  return fmt::format(
             "[FileInfo]\nFileName=kind.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n\n[DeviceInfo]\n"
             "VendorName=Maker\nVendorNumber=0x{:X}\nProductNumber=0x{:X}\nLSS_Supported={}\n\n",
             vendor_of(kind), product_of(kind), has_address(kind) ? 1 : 0) +
         list("MandatoryObjects", {"1000", "1001", "1018"}) + list("OptionalObjects", optional) +
         list("ManufacturerObjects", own) + objects;
}

std::string Mixture::write(const std::string& name, const std::string& text) {
  const std::string path = (folder_ / name).string();
  std::ofstream(path) << text;
  return path;
}

std::string Mixture::words() const {
  std::string text = fmt::format("{} devices at {} bit/s:", members_.size(), machine_.buses.front().bitrate);
  for (const Member& m : members_) text += fmt::format(" {} ({});", m.kind->name, m.id.value());
  return text;
}

}  // namespace berth::field
