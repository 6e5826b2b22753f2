#include "berth/linker/variable_sections_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"
#include "berth/linker/device_pdos_parts.hpp"

namespace berth::linker {
namespace {

/// "A040sub1" is A040h.
std::optional<std::uint16_t> index_of(std::string_view section) {
  constexpr std::size_t digits = 4;
  if (section.size() < digits) return std::nullopt;
  std::uint16_t index = 0;
  const auto [end, wrong] = std::from_chars(section.data(), section.data() + digits, index, 16);
  if (wrong != std::errc() || end != section.data() + digits) return std::nullopt;
  return index;
}

const char* list_of(std::uint16_t index) noexcept {
  return index >= 0x2000 && index < 0x6000 ? "ManufacturerObjects" : "OptionalObjects";
}

class SectionWriter {
 public:
  explicit SectionWriter(const eds::File& file) : file_(file), editor_(file.document) {}

  /// Removes the sections that an earlier run of the linker made.
  void clear() {
    for (const auto& section : file_.document.sections()) {
      const std::string name(file_.document.name(section));
      const auto index = index_of(name);
      if (index && is_dynamic(file_, *index)) editor_.remove_section(name);
    }
    for (const char* const list : {"OptionalObjects", "ManufacturerObjects"}) {
      std::vector<std::string> kept;
      const unsigned count = number(list, "SupportedObjects");
      for (unsigned i = 1; i <= count; ++i) {
        const auto value = editor_.value(list, std::to_string(i)).value_or("");
        const auto parsed = od::parse_number(value);
        if (parsed && parsed->magnitude <= 0xFFFF && is_dynamic(file_, static_cast<std::uint16_t>(parsed->magnitude))) {
          continue;
        }
        kept.push_back(value);
      }
      if (kept.size() == count) continue;
      for (unsigned i = 1; i <= count; ++i) {
        if (i <= kept.size()) {
          set(list, std::to_string(i), kept[i - 1]);
        } else {
          editor_.remove(list, std::to_string(i));
        }
      }
      set(list, "SupportedObjects", std::to_string(kept.size()));
    }
  }

  void add(std::uint16_t index, const std::vector<const Variable*>& variables) {
    const std::string name = fmt::format("{:04X}", index);
    unsigned highest = number(name + "sub0", "DefaultValue");
    const unsigned there = number(name, "SubNumber");
    if (!editor_.has_section(name)) add_object(name, index, variables.front()->type);
    for (const Variable* const each : variables) {
      highest = std::max<unsigned>(highest, each->object.sub);
      add_variable(fmt::format("{}sub{:X}", name, each->object.sub), *each);
    }
    set(name, "SubNumber", std::to_string(std::max(there, 1U) + variables.size()));
    set(name + "sub0", "DefaultValue", std::to_string(highest));
  }

  [[nodiscard]] std::string text() const { return editor_.text(); }
  [[nodiscard]] bool good() const noexcept { return good_; }

 private:
  void set(const std::string& section, const std::string& key, const std::string& value) {
    if (!editor_.set(section, key, value)) good_ = false;
  }
  unsigned number(const std::string& section, const std::string& key) const {
    const auto parsed = od::parse_number(editor_.value(section, key).value_or(""));
    return parsed && parsed->magnitude <= 0xFFFF ? static_cast<unsigned>(parsed->magnitude) : 0;
  }

  void add_object(const std::string& name, std::uint16_t index, od::DataType type) {
    const std::string list = list_of(index);
    const unsigned count = number(list, "SupportedObjects");
    set(list, "SupportedObjects", std::to_string(count + 1));
    set(list, std::to_string(count + 1), fmt::format("0x{:04X}", index));
    set(name, "ParameterName", fmt::format("Network variables {:04X}h", index));
    set(name, "ObjectType", "0x8");
    set(name, "DataType", fmt::format("0x{:04X}", static_cast<unsigned>(type)));
    set(name, "SubNumber", "1");
    const std::string highest = name + "sub0";
    set(highest, "ParameterName", "Highest sub-index supported");
    set(highest, "ObjectType", "0x7");
    set(highest, "DataType", "0x0005");
    set(highest, "AccessType", "ro");
    set(highest, "PDOMapping", "0");
  }

  void add_variable(const std::string& section, const Variable& variable) {
    set(section, "ParameterName", variable.name);
    set(section, "ObjectType", "0x7");
    set(section, "DataType", fmt::format("0x{:04X}", static_cast<unsigned>(variable.type)));
    set(section, "AccessType", variable.input ? "ro" : "rww");
    set(section, "PDOMapping", "1");
  }

  const eds::File& file_;
  eds::Editor editor_;
  bool good_ = true;
};

tl::expected<eds::File, std::string> read_again(std::string text, const Node& node) {
  auto reading = eds::read(std::move(text), node.name);
  if (reading.usable()) return std::move(reading.file);
  const auto error = std::ranges::find(reading.findings, Finding::Severity::error, &Finding::severity);
  return tl::unexpected(to_string(*error));
}

/// Reduces several empty lines to one: removed sections leave theirs.
std::string with_single_gaps(const std::string& text) {
  std::string made;
  unsigned ends = 0;
  for (const char c : text) {
    if (c == '\n') {
      ++ends;
    } else if (c != '\r') {
      ends = 0;
    }
    const bool drop = ends > 2;
    if (drop && c == '\n' && made.ends_with('\r')) made.pop_back();
    if (!drop) made += c;
  }
  return made;
}

}  // namespace

tl::expected<eds::File, std::string> with_variables(const LinkNetwork& network, const Plan& plan, std::size_t node) {
  const Node& it = network.nodes[node];
  std::map<std::uint16_t, std::vector<const Variable*>> by_index;
  for (const Variable& each : plan.variables) {
    if (each.node == node) by_index[each.object.index].push_back(&each);
  }
  const bool has_text = !it.file->document.text().empty();
  if (has_text && by_index.empty() && !it.linked_before) return *it.file;
  eds::File base = *it.file;
  if (!has_text) {
    const auto form = it.file->parameters.empty() ? eds::Form::eds : eds::Form::dcf;
    auto read = read_again(eds::write(*it.file, {.form = form}).text, it);
    if (!read) return read;
    base = std::move(*read);
  }
  SectionWriter writer(base);
  if (it.linked_before) writer.clear();
  for (const auto& [index, variables] : by_index) writer.add(index, variables);
  if (!writer.good()) return tl::unexpected(std::string("its description cannot take the network variables"));
  return read_again(with_single_gaps(writer.text()), it);
}

}  // namespace berth::linker
