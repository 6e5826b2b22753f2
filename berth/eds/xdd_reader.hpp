/// Shared by the sources of the XDD reader. Internal to room `eds`.
#pragma once

#include <map>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "berth/eds/xdd.hpp"

namespace berth::eds::xml {

using Severity = Finding::Severity;
using Node = pugi::xml_node;

/// Limit that ends circular references.
inline constexpr unsigned deepest_reference = 8;

/// The name without its prefix.
[[nodiscard]] std::string_view local(Node node) noexcept;
/// The first child element of this local name; an empty node when there is none.
[[nodiscard]] Node child(Node node, std::string_view name) noexcept;
/// The attribute of this name, ignoring case (`nodeID` and `NodeID` both occur in the field), or "".
[[nodiscard]] std::string_view attribute(Node node, std::string_view name) noexcept;
/// The same with the blanks at its ends.
[[nodiscard]] std::string_view untrimmed(Node node, std::string_view name) noexcept;
[[nodiscard]] std::string_view trimmed(std::string_view text) noexcept;
/// The element's own text.
[[nodiscard]] std::string_view text(Node node) noexcept;
/// Text of the first `label` or `description` in it.
[[nodiscard]] std::string_view words(Node node, std::string_view kind) noexcept;
/// The same, but the English one if there are several.
[[nodiscard]] std::string_view words_in_english(Node node, std::string_view kind) noexcept;
[[nodiscard]] inline std::string_view label(Node node) noexcept { return words_in_english(node, "label"); }

/// The text, its places, and the report.
class Source {
 public:
  Source(std::string_view text, bool places, Report& report);

  /// A remark about an element, or about an attribute's value.
  void tell(Severity severity, Node node, std::string_view attribute, std::string key, std::string message,
            std::string fix = {});
  [[nodiscard]] Report& report() noexcept { return report_; }
  [[nodiscard]] std::uint32_t line_of(Node node) const noexcept { return place(offset(node, {})).line; }

  /// A number from 0 to `most`; empty if missing, or if unreadable, which is reported. `hex`: without 0x
  /// (xsd:hexBinary).
  [[nodiscard]] std::optional<std::uint64_t> number(Node node, std::string_view attribute, std::uint64_t most, bool hex,
                                                    const std::string& key, Severity severity);
  /// xsd:boolean; missing is false.
  [[nodiscard]] bool flag(Node node, std::string_view attribute, const std::string& key);

 private:
  struct Place {
    std::uint32_t line = 0;
    std::uint32_t column = 0;
  };
  [[nodiscard]] std::size_t offset(Node node, std::string_view attribute) const noexcept;
  [[nodiscard]] Place place(std::size_t offset) const noexcept;

  std::string_view text_;
  bool places_;
  std::vector<std::size_t> lines_;  ///< where each line begins
  Report& report_;
};

/// The nodes of a device profile that others refer to.
using NodesById = std::unordered_map<std::string_view, Node>;
/// The `allowedValues` of a parameter or template, its own or those of the template it refers to.
[[nodiscard]] Node allowed_values(Node holder, const NodesById& by_id);

/// `CANopenObjectList` and its references into the `ApplicationProcess`es.
class ObjectList {
 public:
  ObjectList(Source& source, const ReadOptions& options) : source_(source), options_(options) {}

  /// Parameters, templates and data types of a device profile. The nodes must stay.
  void learn(Node application_process);
  void read(Node list);
  /// Writes the result to `file`. `left_out` counts objects without a place in `File`.
  void finish(File& file, std::uint32_t dummies);
  /// "unit" → 3: ignored elements.
  std::map<std::string, std::size_t>& left_out() noexcept { return left_out_; }

 private:
  /// Places of the facts about one value: its own element, then the parameter it refers to, then the parameter's
  /// template.
  struct Facts {
    Node own;
    Node parameter;
    Node model;
    std::string key;
    std::uint16_t index = 0;
    std::uint8_t sub = 0;
  };
  /// A text with the element and attribute it comes from.
  struct Found {
    std::string_view text;
    Node node;
    std::string_view attribute;
  };
  [[nodiscard]] Facts facts(Node own, std::uint16_t index, std::uint8_t sub, bool object);
  void read_object(Node object);
  void read_sub_objects(Node object, const Facts& facts, od::ObjectCode code, od::DataType element);
  void read_simple(const Facts& facts, od::ObjectCode code);
  [[nodiscard]] od::SubSpec spec(const Facts& facts, od::DataType fallback);
  [[nodiscard]] od::DataType data_type(const Facts& facts, od::DataType fallback);
  /// The IEC type of a parameter, after following references; for an ARRAY that of its elements.
  [[nodiscard]] od::DataType iec_type(Node holder, bool elements);
  [[nodiscard]] od::Access access(const Facts& facts, od::DataType type);
  void mapping(const Facts& facts, od::SubSpec& spec);
  void limits(const Facts& facts, od::SubSpec& spec);
  void values(const Facts& facts, od::SubSpec& spec);
  void meaning(const Facts& facts, const od::SubSpec& spec);
  [[nodiscard]] Found value_text(const Facts& facts, std::string_view name) const;
  [[nodiscard]] Found limit_text(const Facts& facts, bool low);
  [[nodiscard]] std::optional<od::Literal> literal(const Facts& facts, const Found& found, od::DataType type,
                                                   Finding::Severity wrong = Finding::Severity::warning);
  void check_limits(const Facts& facts, const Found& found, const od::SubSpec& spec, const od::Literal& value);
  [[nodiscard]] std::string object_name(const Facts& facts);
  [[nodiscard]] std::uint8_t flags(const Facts& facts);
  void count_left_out(Node node);
  void warn(const Facts& facts, Node node, std::string_view attribute, std::string message, std::string fix = {});
  bool afford(Node node, std::size_t sub_objects, std::size_t bytes);

  Source& source_;
  const ReadOptions& options_;
  od::DescriptionBuilder builder_;
  NodesById by_id_;
  std::map<std::string, std::size_t> left_out_;
  std::vector<Parameter> parameters_;
  std::vector<Parameter> defaults_;
  std::vector<Denotation> denotations_;
  std::string scratch_;         ///< holds a name until the builder has copied it
  std::size_t own_values_ = 0;  ///< at objects that cannot have their own
  std::size_t sub_objects_ = 0;
  std::size_t bytes_ = 0;
  bool too_much_ = false;
  bool any_ = false;
};

}  // namespace berth::eds::xml
