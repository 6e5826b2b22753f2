/// The judge of the linker, which shares no code with it: from the written DCFs alone, which bits of which object reach
/// which bits of which other.
#pragma once

#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

namespace berth::test {

/// Node-ID, object as index << 8 | sub-index, bit.
using Bit = std::tuple<unsigned, unsigned, unsigned>;
using Flow = std::set<std::pair<Bit, Bit>>;

struct Judged {
  Flow flow;
  std::vector<std::string> wrong;  ///< what no device would do
};

/// One DCF's objects by sections, read here.
class Dcf {
 public:
  explicit Dcf(const std::string& text);
  [[nodiscard]] unsigned node_id() const { return node_id_; }
  [[nodiscard]] std::string text(unsigned index, unsigned sub, const std::string& key) const;
  [[nodiscard]] bool has(unsigned index, unsigned sub) const;
  /// ParameterValue, else DefaultValue, with $NODEID added.
  [[nodiscard]] unsigned long long value(unsigned index, unsigned sub) const;
  /// Index and sub-index of the name in Denotation or ParameterName; 0 when there is none.
  [[nodiscard]] unsigned named(const std::string& name) const;
  [[nodiscard]] unsigned bits(unsigned index, unsigned sub) const;
  [[nodiscard]] std::string commissioned(const std::string& key) const;
  [[nodiscard]] std::set<unsigned> listed() const;  ///< objects in the three lists

 private:
  std::map<std::string, std::map<std::string, std::string>> sections_;
  unsigned node_id_ = 0;
};

[[nodiscard]] Judged judge(const std::vector<Dcf>& devices);

}  // namespace berth::test
