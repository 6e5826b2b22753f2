#include "tests/linker/judge.hpp"

#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <sstream>

namespace berth::test {
namespace {

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}
std::string section_name(unsigned index, unsigned sub, bool whole) {
  char name[32];
  if (whole) {
    std::snprintf(name, sizeof name, "%04X", index);
  } else {
    std::snprintf(name, sizeof name, "%04XSUB%X", index, sub);
  }
  return name;
}
std::string words(const char* what, unsigned node, unsigned number) {
  return "node " + std::to_string(node) + ": " + what + " " + std::to_string(number);
}

struct Frame {
  unsigned node = 0;
  unsigned number = 0;
  unsigned long long id = 0;
  bool mpdo = false;
  std::vector<Bit> bits;  // what stands in each bit
};

class Judge {
 public:
  explicit Judge(const std::vector<Dcf>& devices) : devices_(devices) {}

  Judged run() {
    for (const Dcf& each : devices_) send(each);
    for (const Dcf& each : devices_) receive(each);
    return made_;
  }

 private:
  void tell(const std::string& what) { made_.wrong.push_back(what); }

  // The bits of a mapping; dummies are objects below 20h.
  std::vector<Bit> mapped(const Dcf& device, unsigned mapping, const char* what, bool sends) {
    std::vector<Bit> bits;
    for (unsigned at = 1; at <= device.value(mapping, 0); ++at) {
      const auto raw = device.value(mapping, at);
      const unsigned index = static_cast<unsigned>(raw >> 16);
      const unsigned sub = static_cast<unsigned>(raw >> 8) & 0xFF;
      const unsigned length = static_cast<unsigned>(raw) & 0xFF;
      if (index >= 0x20) {
        const auto access = device.text(index, sub, "ACCESSTYPE");
        if (!device.has(index, sub)) tell(words("no object in", device.node_id(), mapping));
        if (device.text(index, sub, "PDOMAPPING") != "1") tell(words("not mappable in", device.node_id(), mapping));
        if (device.bits(index, sub) != length) tell(words("wrong length in", device.node_id(), mapping));
        if (sends ? access == "rww" || access == "wo" : access == "ro" || access == "rwr" || access == "const") {
          tell(words("wrong way in", device.node_id(), mapping));
        }
      } else if (sends || device.text(0, index, "dummy") != "1") {
        tell(words("dummy that may not be in", device.node_id(), mapping));
      }
      for (unsigned bit = 0; bit < length; ++bit) bits.emplace_back(device.node_id(), index << 8 | sub, bit);
    }
    if (bits.size() > 64) tell(words(what, device.node_id(), mapping) + " longer than 64 bits");
    return bits;
  }

  void check_id(unsigned long long id, unsigned node) {
    const bool restricted = id <= 0x180 || (id >= 0x580 && id < 0x680) || id >= 0x6E0;
    if (restricted) tell(words("restricted CAN-ID", node, static_cast<unsigned>(id)));
  }

  void send(const Dcf& device) {
    for (unsigned n = 0; n < 512; ++n) {
      if (!device.has(0x1800 + n, 1)) continue;
      const auto cob = device.value(0x1800 + n, 1);
      if ((cob & 0x80000000U) != 0) continue;
      Frame frame{device.node_id(), n + 1, cob & 0x7FF, device.value(0x1A00 + n, 0) == 254, {}};
      check_id(frame.id, frame.node);
      for (const Frame& other : frames_) {
        if (other.id == frame.id) tell(words("second sender of CAN-ID", frame.node, static_cast<unsigned>(frame.id)));
      }
      if (!frame.mpdo) frame.bits = mapped(device, 0x1A00 + n, "TPDO", true);
      frames_.push_back(std::move(frame));
    }
  }

  void receive(const Dcf& device) {
    std::set<unsigned long long> heard;
    for (unsigned n = 0; n < 512; ++n) {
      if (!device.has(0x1400 + n, 1)) continue;
      const auto cob = device.value(0x1400 + n, 1);
      if ((cob & 0x80000000U) != 0) continue;
      if (!heard.insert(cob & 0x7FF).second) tell(words("two RPDOs for CAN-ID", device.node_id(), cob & 0x7FF));
      for (const Frame& frame : frames_) {
        if (frame.id == (cob & 0x7FF)) take(device, 0x1600 + n, frame);
      }
    }
  }

  void take(const Dcf& device, unsigned mapping, const Frame& frame) {
    const bool mpdo = device.value(mapping, 0) == 254;
    if (mpdo != frame.mpdo) return tell(words("MPDO and PDO mixed", device.node_id(), mapping));
    if (mpdo) return dispatch(device, frame);
    const auto bits = mapped(device, mapping, "RPDO", false);
    if (bits.size() != frame.bits.size()) tell(words("RPDO as long as its TPDO", device.node_id(), mapping));
    for (std::size_t i = 0; i < bits.size() && i < frame.bits.size(); ++i) {
      if (std::get<1>(bits[i]) >> 8 >= 0x20) made_.flow.insert({frame.bits[i], bits[i]});
    }
  }

  // The producer sends what its scanner list has, the consumer takes what its dispatching list has.
  void dispatch(const Dcf& device, const Frame& frame) {
    const Dcf* producer = nullptr;
    for (const Dcf& each : devices_) {
      if (each.node_id() == frame.node) producer = &each;
    }
    std::set<unsigned> scanned;
    for (unsigned sub = 1; producer->has(0x1FA0, sub); ++sub) {
      const auto raw = producer->value(0x1FA0, sub);
      if (raw >> 24 == 1) scanned.insert(static_cast<unsigned>(raw & 0xFFFFFF));
    }
    for (unsigned sub = 1; device.has(0x1FD0, sub); ++sub) {
      const auto raw = device.value(0x1FD0, sub);
      if (raw >> 56 != 1 || (raw & 0xFF) != frame.node) continue;
      const auto from = static_cast<unsigned>(raw >> 8 & 0xFFFFFF);
      const auto to = static_cast<unsigned>(raw >> 32 & 0xFFFFFF);
      if (!scanned.contains(from)) continue;
      for (unsigned bit = 0; bit < device.bits(to >> 8, to & 0xFF); ++bit) {
        made_.flow.insert({{frame.node, from, bit}, {device.node_id(), to, bit}});
      }
    }
  }

  const std::vector<Dcf>& devices_;
  std::vector<Frame> frames_;
  Judged made_;
};

}  // namespace

Dcf::Dcf(const std::string& text) {
  std::istringstream lines(text);
  std::string section;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line.front() == ';') continue;
    if (line.front() == '[') {
      section = upper(line.substr(1, line.find(']') - 1));
      continue;
    }
    const auto equals = line.find('=');
    if (equals != std::string::npos) sections_[section][upper(line.substr(0, equals))] = line.substr(equals + 1);
  }
  node_id_ = static_cast<unsigned>(std::strtoul(commissioned("NODEID").c_str(), nullptr, 0));
}

std::string Dcf::commissioned(const std::string& key) const {
  const auto section = sections_.find("DEVICECOMISSIONING");
  if (section == sections_.end() || !section->second.contains(upper(key))) return {};
  return section->second.at(upper(key));
}

std::string Dcf::text(unsigned index, unsigned sub, const std::string& key) const {
  if (key == "dummy") {
    char name[16];
    std::snprintf(name, sizeof name, "DUMMY%04X", sub);
    const auto dummies = sections_.find("DUMMYUSAGE");
    return dummies != sections_.end() && dummies->second.contains(name) ? dummies->second.at(name) : "";
  }
  auto section = sections_.find(section_name(index, sub, false));
  if (section == sections_.end() && sub == 0) section = sections_.find(section_name(index, 0, true));
  if (section == sections_.end() || !section->second.contains(upper(key))) return {};
  return section->second.at(upper(key));
}

bool Dcf::has(unsigned index, unsigned sub) const { return !text(index, sub, "DATATYPE").empty(); }

unsigned long long Dcf::value(unsigned index, unsigned sub) const {
  std::string text = this->text(index, sub, "PARAMETERVALUE");
  if (text.empty()) text = this->text(index, sub, "DEFAULTVALUE");
  if (text.empty()) return 0;
  unsigned long long add = 0;
  const std::string formula = "$NODEID+";
  if (upper(text).starts_with(formula)) {
    add = node_id_;
    text = text.substr(formula.size());
  }
  return std::strtoull(text.c_str(), nullptr, 0) + add;
}

unsigned Dcf::named(const std::string& name) const {
  for (const auto& [section, keys] : sections_) {
    const auto sub = section.find("SUB");
    const bool is = (keys.contains("DENOTATION") && keys.at("DENOTATION") == name) ||
                    (keys.contains("PARAMETERNAME") && keys.at("PARAMETERNAME") == name);
    if (!is || sub != 4) continue;
    return static_cast<unsigned>(std::strtoul(section.substr(0, 4).c_str(), nullptr, 16) << 8 |
                                 std::strtoul(section.substr(7).c_str(), nullptr, 16));
  }
  return 0;
}

unsigned Dcf::bits(unsigned index, unsigned sub) const {
  static const std::map<unsigned, unsigned> lengths{{0x01, 1},  {0x02, 8},  {0x03, 16}, {0x04, 32}, {0x05, 8},
                                                    {0x06, 16}, {0x07, 32}, {0x08, 32}, {0x10, 24}, {0x11, 64},
                                                    {0x12, 40}, {0x13, 48}, {0x14, 56}, {0x15, 64}, {0x16, 24},
                                                    {0x18, 40}, {0x19, 48}, {0x1A, 56}, {0x1B, 64}};
  const auto type = static_cast<unsigned>(std::strtoul(text(index, sub, "DATATYPE").c_str(), nullptr, 0));
  const auto found = lengths.find(type);
  return found == lengths.end() ? 0 : found->second;
}

std::set<unsigned> Dcf::listed() const {
  std::set<unsigned> made;
  for (const char* const list : {"MANDATORYOBJECTS", "OPTIONALOBJECTS", "MANUFACTUREROBJECTS"}) {
    const auto section = sections_.find(list);
    if (section == sections_.end()) continue;
    const auto count = std::strtoul(section->second.at("SUPPORTEDOBJECTS").c_str(), nullptr, 0);
    for (unsigned long i = 1; i <= count; ++i) {
      made.insert(static_cast<unsigned>(std::strtoul(section->second.at(std::to_string(i)).c_str(), nullptr, 0)));
    }
  }
  return made;
}

Judged judge(const std::vector<Dcf>& devices) { return Judge(devices).run(); }

}  // namespace berth::test
