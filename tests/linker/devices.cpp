#include "tests/linker/devices.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <sstream>
#include <stdexcept>

#include "berth/eds/eds.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;

struct Segment {
  unsigned type;
  unsigned first;
};
// CiA 405, as protocol-facts B.9 has it: the outputs are 480h behind the inputs.
constexpr Segment segments[] = {{0x02, 0xA000}, {0x05, 0xA040}, {0x01, 0xA080}, {0x03, 0xA0C0}, {0x06, 0xA100},
                                {0x10, 0xA140}, {0x16, 0xA180}, {0x04, 0xA1C0}, {0x07, 0xA200}, {0x08, 0xA240},
                                {0x15, 0xA400}, {0x1B, 0xA440}, {0x18, 0xA280}, {0x12, 0xA2C0}, {0x19, 0xA300},
                                {0x13, 0xA340}, {0x1A, 0xA380}, {0x14, 0xA3C0}};

std::string one(const std::string& section, const std::string& name, unsigned type, const std::string& access,
                bool mappable, const std::string& value = {}) {
  return fmt::format("[{}]\nParameterName={}\nObjectType=0x7\nDataType=0x{:04X}\nAccessType={}\nPDOMapping={}\n{}\n",
                     section, name, type, access, mappable ? 1 : 0,
                     value.empty() ? "" : fmt::format("DefaultValue={}\n", value));
}
std::string head(unsigned index, const std::string& name, unsigned code, unsigned subs) {
  return fmt::format("[{:04X}]\nParameterName={}\nObjectType=0x{:X}\nSubNumber={}\n\n", index, name, code, subs);
}

class Text {
 public:
  explicit Text(const DeviceSpec& spec) : spec_(spec) {}

  std::string run() {
    info();
    for (unsigned i = 0; i < spec_.rpdos; ++i) pdo(0x1400 + i, 0x1600 + i, i, 0x200);
    for (unsigned i = 0; i < spec_.tpdos; ++i) pdo(0x1800 + i, 0x1A00 + i, i, 0x180);
    if (spec_.mpdo > 0) {
      list(0x1FA0, 0x07);
      list(0x1FD0, 0x1B);
    }
    for (const auto& each : spec_.objects) objects(each);
    if (spec_.dynamic) dynamic();
    return text_ + lists();
  }

 private:
  void info() {
    text_ += fmt::format(
        "[FileInfo]\nFileName={0}.eds\nFileVersion=1\nFileRevision=1\nEDSVersion=4.0\nModifiedBy=test\n\n[DeviceInfo]\n"
        "VendorName=test\nVendorNumber=1\nProductName={0}\nProductNumber=9\nRevisionNumber=1\nBaudRate_125=1\n"
        "BaudRate_500=1\nSimpleBootUpSlave=1\nGranularity={1}\nDynamicChannelsSupported={2}\nNrOfRXPDO={3}\n"
        "NrOfTXPDO={4}\nLSS_Supported=1\n\n[DummyUsage]\n",
        spec_.name, spec_.granularity, spec_.dynamic ? 1 : 0, spec_.rpdos, spec_.tpdos);
    for (unsigned type = 1; type <= 7; ++type) {
      const bool may = type == 1 ? spec_.bit_dummy : spec_.dummies;
      text_ += fmt::format("Dummy{:04X}={}\n", type, may ? 1 : 0);
    }
    text_ +=
        "\n" + one("1000", "Device type", 7, "ro", false, "0") + one("1001", "Error register", 5, "ro", false, "0");
    text_ += head(0x1018, "Identity object", 9, 5) + one("1018sub0", "Highest sub-index", 5, "const", false, "4");
    for (unsigned sub = 1; sub <= 4; ++sub) {
      text_ += one(fmt::format("1018sub{}", sub), fmt::format("Part {}", sub), 7, "ro", false, sub == 1 ? "1" : "9");
    }
  }

  void pdo(unsigned communication, unsigned mapping, unsigned number, unsigned base) {
    const bool predefined = number < 4;
    const std::string id = predefined ? fmt::format("$NODEID+0x{:X}", base + number * 0x100) : "0x80000000";
    text_ += head(communication, fmt::format("PDO {}", number + 1), 9, spec_.timers ? 5 : 3);
    const auto sub = [&](unsigned at, unsigned type, const char* access, const std::string& value) {
      text_ +=
          one(fmt::format("{:04X}sub{:X}", communication, at), fmt::format("Entry {}", at), type, access, false, value);
    };
    sub(0, 5, "const", spec_.timers ? "5" : "2");
    sub(1, 7, "rw", id);
    sub(2, 5, "rw", "255");
    if (spec_.timers) {
      sub(3, 6, "rw", "0");
      sub(5, 6, "rw", "0");
    }
    std::vector<std::string> entries;
    std::istringstream words(number == 0 && base == 0x180 ? spec_.mapping : "");
    for (std::string word; words >> word;) entries.push_back("0x" + word);
    const char* const access = spec_.fixed ? "ro" : "rw";
    text_ += head(mapping, fmt::format("Mapping {}", number + 1), 9, spec_.entries + 1);
    text_ +=
        one(fmt::format("{:04X}sub0", mapping), "Number of objects", 5, access, false, std::to_string(entries.size()));
    for (unsigned at = 1; at <= spec_.entries; ++at) {
      text_ += one(fmt::format("{:04X}sub{:X}", mapping, at), fmt::format("Object {}", at), 7, access, false,
                   at <= entries.size() ? entries[at - 1] : "0");
    }
    add(communication);
    add(mapping);
  }

  void list(unsigned index, unsigned type) {
    text_ += head(index, "MPDO list", 8, spec_.mpdo + 1) +
             one(fmt::format("{:04X}sub0", index), "Highest", 5, "ro", false, "254");
    for (unsigned sub = 1; sub <= spec_.mpdo; ++sub) {
      text_ += one(fmt::format("{:04X}sub{:X}", index, sub), fmt::format("Entry {}", sub), type, "rw", false, "0");
    }
    add(index);
  }

  void objects(const ObjectSpec& spec) {
    text_ += head(spec.index, spec.name, 8, spec.subs + 1);
    text_ += one(fmt::format("{:04X}sub0", spec.index), "Highest", 5, "ro", false, std::to_string(spec.subs));
    for (unsigned sub = 1; sub <= spec.subs; ++sub) {
      text_ += one(fmt::format("{:04X}sub{:X}", spec.index, sub), fmt::format("{} {}", spec.name, sub), spec.type,
                   spec.access, spec.mappable);
    }
    add(spec.index);
  }

  void dynamic() {
    text_ += fmt::format("[DynamicChannels]\nNrOfSeg={}\n", 2 * std::size(segments));
    unsigned number = 0;
    for (const auto& [type, first] : segments) {
      for (const bool input : {true, false}) {
        ++number;
        const unsigned at = input ? first : first + 0x480;
        text_ += fmt::format("Type{0}=0x{1:04X}\nDir{0}={2}\nRange{0}=0x{3:04X}-0x{4:04X}\nPPOffset{0}=0x{5:X}\n",
                             number, type, input ? "ro" : "rww", at, at + 0x3F, (number - 1) / 2 * 0x2000);
      }
    }
    text_ += "\n";
  }

  void add(unsigned index) { (index >= 0x2000 && index < 0x6000 ? own_ : optional_).insert(index); }
  std::string lists() const {
    std::string made = "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n\n";
    for (const auto& [name, set] :
         {std::pair("OptionalObjects", &optional_), std::pair("ManufacturerObjects", &own_)}) {
      made += fmt::format("[{}]\nSupportedObjects={}\n", name, set->size());
      unsigned number = 0;
      for (const unsigned index : *set) made += fmt::format("{}=0x{:04X}\n", ++number, index);
      made += "\n";
    }
    return made;
  }

  const DeviceSpec& spec_;
  std::string text_;
  std::set<unsigned> optional_;
  std::set<unsigned> own_;
};

}  // namespace

std::string eds_text(const DeviceSpec& spec) { return Text(spec).run(); }

std::shared_ptr<const eds::File> file_of(const DeviceSpec& spec) {
  auto reading = eds::read(eds_text(spec), spec.name);
  if (!reading.usable())
    throw std::runtime_error("the test's own description is wrong: " + to_string(reading.findings.front()));
  return std::make_shared<const eds::File>(std::move(reading.file));
}

DeviceSpec controller() {
  return {.name = "controller",
          .tpdos = 48,
          .rpdos = 64,
          .entries = 16,
          .dynamic = true,
          .objects = {{0x2100, 64, 5, "rww", "Input byte"},
                      {0x2101, 64, 3, "rww", "Input word"},
                      {0x2200, 64, 5, "rwr", "Output byte"},
                      {0x2201, 64, 3, "rwr", "Output word"}}};
}

DeviceSpec io_module() {
  return {.name = "io",
          .tpdos = 4,
          .rpdos = 4,
          .entries = 8,
          .objects = {{0x6000, 2, 5, "ro", "Read input 8 bit"},
                      {0x6200, 2, 5, "rww", "Write output 8 bit"},
                      {0x6401, 4, 3, "ro", "Read analogue input 16 bit"},
                      {0x6411, 2, 3, "rww", "Write analogue output 16 bit"}}};
}

linker::LinkNetwork network_of(std::vector<std::pair<std::string, std::shared_ptr<const eds::File>>> nodes) {
  linker::LinkNetwork network{
      .name = "machine", .file = "machine.toml", .buses = {}, .nodes = {}, .gateways = {}, .links = {}};
  linker::Bus bus{.name = "field", .master = NodeId(127)};
  bus.others.bit_rate = 500'000;
  bus.others.background_bytes = 8;
  std::uint8_t id = 1;
  for (auto& [name, file] : nodes) {
    bus.others.senders.push_back({name});
    bus.others.messages.push_back({.name = "heartbeat",
                                   .sender = bus.others.senders.size() - 1,
                                   .key = 0x700U + id,
                                   .data_bytes = 1,
                                   .period = 1s});
    network.nodes.push_back({.name = name, .bus = 0, .id = NodeId(id++), .file = std::move(file)});
  }
  network.buses.push_back(std::move(bus));
  return network;
}

namespace {
linker::End end_of(const linker::LinkNetwork& network, const std::string& text) {
  const auto slash = text.find('/');
  const auto node = std::ranges::find(network.nodes, text.substr(0, slash), &linker::Node::name);
  if (node == network.nodes.end()) throw std::runtime_error("no node " + text);
  return {static_cast<std::size_t>(node - network.nodes.begin()), text.substr(slash + 1)};
}
}  // namespace

void add_link(linker::LinkNetwork& network, const std::string& from, const std::vector<std::string>& to,
              std::optional<rt::Duration> deadline, linker::TransmissionType transmission,
              std::optional<od::DataType> type) {
  linker::Link link{
      .from = end_of(network, from), .to = {}, .deadline = deadline, .transmission = transmission, .type = type};
  for (const auto& each : to) link.to.push_back(end_of(network, each));
  link.place = {static_cast<int>(100 + network.links.size()), 1};
  network.links.push_back(std::move(link));
}

linker::LinkNetwork conveyor() {
  constexpr unsigned controllers = 11;
  constexpr unsigned modules = 4;  // of each controller
  const auto plc = file_of(controller());
  const auto io = file_of(io_module());
  std::vector<std::pair<std::string, std::shared_ptr<const eds::File>>> nodes;
  for (unsigned c = 0; c < controllers; ++c) nodes.emplace_back(fmt::format("plc{}", c), plc);
  for (unsigned m = 0; m < controllers * modules; ++m) nodes.emplace_back(fmt::format("io{}", m), io);
  auto network = network_of(std::move(nodes));
  for (unsigned m = 0; m < controllers * modules; ++m) {
    const unsigned c = m / modules;
    const unsigned at = m % modules;
    for (unsigned i = 1; i <= 2; ++i) {
      add_link(network, fmt::format("io{}/6000h:{:02X}", m, i), {fmt::format("plc{}/2100h:{:02X}", c, at * 2 + i)},
               100ms);
      add_link(network, fmt::format("plc{}/2200h:{:02X}", c, at * 2 + i), {fmt::format("io{}/6200h:{:02X}", m, i)},
               100ms);
      add_link(network, fmt::format("plc{}/2201h:{:02X}", c, at * 2 + i), {fmt::format("io{}/6411h:{:02X}", m, i)},
               500ms);
    }
    for (unsigned i = 1; i <= 4; ++i) {
      add_link(network, fmt::format("io{}/6401h:{:02X}", m, i), {fmt::format("plc{}/2101h:{:02X}", c, at * 4 + i)},
               500ms);
    }
  }
  // 93 variables sent, one of them to three, the others to two each: 93 inputs and 187 outputs.
  constexpr od::DataType types[] = {od::DataType::unsigned8, od::DataType::integer16, od::DataType::unsigned16,
                                    od::DataType::real32, od::DataType::unsigned32};
  for (unsigned v = 0; v < 93; ++v) {
    const unsigned from = v % controllers;
    std::vector<std::string> to;
    for (unsigned k = 1; k <= (v == 0 ? 3U : 2U); ++k)
      to.push_back(fmt::format("plc{}/v{}", (from + k) % controllers, v));
    add_link(network, fmt::format("plc{}/v{}", from, v), to, v % 3 == 0 ? 100ms : 200ms, linker::at_change,
             types[v % 5]);
  }
  return network;
}

void add_random_links(linker::LinkNetwork& network, Random& random, unsigned links) {
  const unsigned base = static_cast<unsigned>(network.links.size());
  const auto pick = [&](unsigned most) { return static_cast<unsigned>(random.below(most)); };
  std::set<std::string> taken;
  for (const auto& link : network.links) {
    for (const auto& to : link.to) taken.insert(network.nodes[to.node].name + "/" + to.object);
  }
  for (unsigned n = 0; n < links; ++n) {
    const auto& from = network.nodes[pick(static_cast<unsigned>(network.nodes.size()))];
    const bool variable = !from.file->dynamic_segments.empty();
    const bool word = pick(2) == 0;
    const std::string object = variable ? fmt::format("v{}", base + n)
                                        : fmt::format("{}h:0{}", word ? "6401" : "6000", 1 + pick(word ? 4 : 2));
    std::vector<std::string> to;
    std::set<std::string> used{from.name};
    for (unsigned k = 0; k < 1 + pick(3); ++k) {
      const auto& node = network.nodes[pick(static_cast<unsigned>(network.nodes.size()))];
      if (!used.insert(node.name).second) continue;
      const bool there = !node.file->dynamic_segments.empty();
      const std::string target =
          node.name + "/" +
          (there ? fmt::format("r{}", base + n) : fmt::format("{}h:0{}", word ? "6411" : "6200", 1 + pick(2)));
      if (taken.insert(target).second) to.push_back(target);
    }
    if (to.empty()) continue;
    std::optional<rt::Duration> deadline;
    if (pick(4) != 0) deadline = std::chrono::milliseconds(100 * (1 + pick(20)));
    const auto type = word ? od::DataType::integer16 : od::DataType::unsigned8;
    const std::string source = from.name + "/" + object;
    const bool again = std::ranges::any_of(network.links, [&](const auto& l) {
      if (network.nodes[l.from.node].name != from.name || l.from.object != object) return false;
      return std::ranges::any_of(l.to, [&](const auto& t) {
        return std::ranges::any_of(to, [&](const auto& x) { return x.starts_with(network.nodes[t.node].name + "/"); });
      });
    });
    if (!again) add_link(network, source, to, deadline, linker::at_change, type);
  }
}

linker::LinkNetwork random_network(Random& random, unsigned links) {
  auto small = controller();
  small.tpdos = 3;
  small.rpdos = 5;
  small.entries = 6;
  std::vector<std::pair<std::string, std::shared_ptr<const eds::File>>> nodes;
  // Read once for all the networks of a run: half of a small network's time.
  static const auto big = file_of(controller());
  static const auto little = file_of(small);
  static const auto io = file_of(io_module());
  for (unsigned i = 0; i < 2 + random.below(3); ++i) nodes.emplace_back(fmt::format("big{}", i), big);
  for (unsigned i = 0; i < random.below(3); ++i) nodes.emplace_back(fmt::format("small{}", i), little);
  for (unsigned i = 0; i < 1 + random.below(5); ++i) nodes.emplace_back(fmt::format("io{}", i), io);
  auto network = network_of(std::move(nodes));
  add_random_links(network, random, links);
  return network;
}

}  // namespace berth::test
