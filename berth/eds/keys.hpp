/// The keys of the sections of one object, and their meaning. Internal to room `eds`.
#pragma once

#include <fmt/format.h>

#include <array>
#include <span>
#include <string>
#include <vector>

#include "berth/eds/context.hpp"
#include "berth/eds/eds.hpp"

namespace berth::eds {

/// The keys of an object or sub-object.
enum class Key : std::uint8_t {
  parameter_name,
  object_type,
  data_type,
  access_type,
  default_value,
  pdo_mapping,
  sub_number,
  low_limit,
  high_limit,
  obj_flags,
  compact_sub_obj,
  parameter_value,
  upload_file,
  download_file,
  denotation,
  param_refd,
  count
};
using Keys = std::array<const Entry*, static_cast<std::size_t>(Key::count)>;
[[nodiscard]] inline const Entry* entry(const Keys& keys, Key key) noexcept {
  return keys[static_cast<std::size_t>(key)];
}

/// The subject of a section named after an object.
enum class Part : std::uint8_t { object, sub, name, value, denotation, links };
struct ObjectSection {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  Part part = Part::object;
  const Section* section = nullptr;
  [[nodiscard]] std::uint32_t order() const noexcept {
    return (static_cast<std::uint32_t>(index) << 16U) | (static_cast<std::uint32_t>(part) << 8U) | sub;
  }
};
/// All sections of one object.
struct ObjectGroup {
  std::uint16_t index = 0;
  const Section* main = nullptr;  ///< null: there are only [xxxxsubN] sections
  Keys keys{};
  std::span<const ObjectSection> subs;
  const Section* names = nullptr;
  const Section* values = nullptr;
  const Section* denotations = nullptr;
  const Section* links = nullptr;
};
/// Defaults for missing keys.
struct Fallback {
  std::uint8_t sub = 0;
  od::DataType type = od::DataType::none;
};

/// Values set by a DCF, in addition to the description.
struct DcfValues {
  std::vector<Parameter> parameters{};
  std::vector<Parameter> defaults{};
  std::vector<FileReference> file_references{};
  std::vector<Denotation> denotations{};
  std::vector<ParamRef> param_refs{};
  std::vector<ObjectLinks> object_links{};
};

/// How much a file may describe.
class ReadBudget {
 public:
  ReadBudget(Context& context, const ReadOptions& options) noexcept : context_(&context), options_(&options) {}
  /// False (and one error) when the file exceeds a limit of `ReadOptions`.
  bool afford(const Section* section, std::size_t sub_objects, std::size_t bytes);
  /// Nothing more is read.
  [[nodiscard]] bool spent() const noexcept { return spent_; }

 private:
  Context* context_;
  const ReadOptions* options_;
  std::size_t sub_objects_ = 0;
  std::size_t bytes_ = 0;
  bool spent_ = false;
};

/// The keys of one object or sub-object: names, types, access, values and limits.
class KeyReader {
 public:
  /// `values` collects what sections set in addition to the description.
  KeyReader(Context& context, DcfValues& values) noexcept : context_(context), values_(values) {}

  /// `own`: further keys that the section may have.
  void collect(const Section& section, Keys& keys, std::span<const std::string_view> own = {});
  [[nodiscard]] bool given(const Keys& keys, Key key) const noexcept { return !context_.raw(entry(keys, key)).empty(); }
  [[nodiscard]] od::ObjectCode object_code(const ObjectGroup& group, bool has_subs);
  /// Its name is valid until the next call.
  [[nodiscard]] od::SubSpec spec(const ObjectGroup& group, const Section& section, const Keys& keys,
                                 const Fallback& fallback);
  [[nodiscard]] std::string_view parameter_name(const ObjectGroup& group, const Section& section, const Keys& keys,
                                                const Fallback& fallback);
  [[nodiscard]] od::DataType data_type(const Section& section, const Keys& keys, const Fallback& fallback);
  void check_limits(const Section& section, const Entry* entry, const od::SubSpec& spec, const od::Literal& value);
  /// `wrong`: severity of an invalid text.
  [[nodiscard]] std::optional<od::Literal> literal(const Section& section, const Entry* entry, od::DataType type,
                                                   Finding::Severity wrong = Finding::Severity::error);

 private:
  [[nodiscard]] od::Access access(const Section& section, const Keys& keys, const Fallback& fallback,
                                  od::DataType type);
  void limits(const Section& section, const Keys& keys, od::SubSpec& spec);
  [[nodiscard]] od::Literal limit(const Section& section, const Entry* entry, od::DataType type, bool low);
  void initial(ObjectRef ref, const Section& section, const Keys& keys, od::SubSpec& spec);
  void extras(ObjectRef ref, const Section& section, const Keys& keys);

  Context& context_;
  DcfValues& values_;
  std::string name_;  // until the builder has copied it
};

/// Calls `each(number, entry)` for the entries of a list; warns when `counter` gives another number of them.
template <class F>
void numbered(Context& context, const Section& section, const char* counter, F&& each) {
  std::optional<std::uint64_t> promised;
  std::size_t found = 0;
  for (const Entry& entry : context.document().entries(section)) {
    const std::string_view key = context.document().key(entry);
    if (same_word(key, counter)) {
      promised = context.number(section, &entry, 0xFFFF'FFFF, Finding::Severity::warning);
      continue;
    }
    const auto number = number_key(key);
    if (!number) {
      context.warn(section, &entry, fmt::format("neither {} nor a number; left out", counter));
      continue;
    }
    if (context.raw(&entry).empty()) continue;
    ++found;
    each(*number, entry);
  }
  if (!promised) {
    context.warn(section, nullptr, fmt::format("{} is missing; {} entries are there", counter, found));
  } else if (*promised != found) {
    context.warn(section, nullptr, fmt::format("{} says {}, {} are there", counter, *promised, found));
  }
}

}  // namespace berth::eds
