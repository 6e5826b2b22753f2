/// The object sections of a device description: [1018], [1018sub1], [2050Name], [2050Value]... Inside of room `eds`
/// only.
#pragma once

#include <fmt/format.h>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "berth/eds/context.hpp"
#include "berth/eds/eds.hpp"

namespace berth::eds {

/// What a section named after an object describes.
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
/// "1018", "1018sub1", "2050Name"; empty for every other name.
[[nodiscard]] std::optional<ObjectSection> object_section(std::string_view name) noexcept;

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

/// What a section of a module describes.
enum class ModulePart : std::uint8_t { info, comments, fixed_list, fixed, fixed_sub, extension_list, extension };
struct ModuleSection {
  std::uint16_t module = 0;
  ModulePart part = ModulePart::info;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  const Section* section = nullptr;
  [[nodiscard]] std::uint64_t order() const noexcept {
    const auto group = part == ModulePart::fixed_sub ? ModulePart::fixed : part;
    return static_cast<std::uint64_t>(module) << 48U | static_cast<std::uint64_t>(group) << 40U |
           static_cast<std::uint64_t>(index) << 16U | (part == ModulePart::fixed_sub ? sub + 1U : 0U);
  }
};
/// "M1ModuleInfo", "M1Fixed6423sub1"; empty for every other name.
[[nodiscard]] std::optional<ModuleSection> module_section(std::string_view name) noexcept;
/// Up to four hex digits.
[[nodiscard]] std::optional<std::uint32_t> hex_word(std::string_view text) noexcept;

class ObjectReader {
 public:
  ObjectReader(Context& context, const DeviceInfo& device, const ReadOptions& options);

  /// Reads the object lists and all object sections into `file`.
  void run(File& file, std::uint32_t dummies);

 private:
  /// All sections of one object.
  struct Group {
    std::uint16_t index = 0;
    const Section* main = nullptr;  ///< null: only [xxxxsubN] sections stand there
    Keys keys{};
    std::span<const ObjectSection> subs;
    const Section* names = nullptr;
    const Section* values = nullptr;
    const Section* denotations = nullptr;
    const Section* links = nullptr;
  };
  /// What to take for a key that is missing.
  struct Fallback {
    std::uint8_t sub = 0;
    od::DataType type = od::DataType::none;
  };

  void classify();
  void read_lists();
  void read_list(const Section& section, std::uint16_t first, std::uint16_t last);
  void check_listed(const Group& group);
  void missing_sections();
  [[nodiscard]] Group group(std::span<const ObjectSection> sections);
  /// `own`: further keys that the section may have.
  void collect(const Section& section, Keys& keys, std::span<const std::string_view> own = {});
  void read_group(const Group& group);
  [[nodiscard]] od::ObjectCode object_code(const Group& group, bool has_subs);
  void read_simple(const Group& group, od::ObjectCode code);
  void read_complex(const Group& group, od::ObjectCode code);
  void read_compact(const Group& group, unsigned count);
  void check_sub_number(const Group& group, bool compact);
  void read_sub(const Group& group, const Section& section, const Keys& keys, std::uint8_t sub, od::DataType type);
  void name_list(const Group& group, unsigned count, std::vector<std::string>& names);
  void value_list(const Group& group);
  void denotation_list(const Group& group);
  void links(const Group& group);
  /// Calls `each(number, entry)` for the entries of a list; warns when `counter` says another number of them.
  template <class F>
  void numbered(const Section& section, const char* counter, F&& each);

  [[nodiscard]] od::SubSpec spec(const Group& group, const Section& section, const Keys& keys,
                                 const Fallback& fallback);
  [[nodiscard]] std::string_view parameter_name(const Group& group, const Section& section, const Keys& keys,
                                                const Fallback& fallback);
  [[nodiscard]] od::DataType data_type(const Section& section, const Keys& keys, const Fallback& fallback);
  [[nodiscard]] od::Access access(const Section& section, const Keys& keys, const Fallback& fallback,
                                  od::DataType type);
  void limits(const Section& section, const Keys& keys, od::SubSpec& spec);
  [[nodiscard]] od::Literal limit(const Section& section, const Entry* entry, od::DataType type, bool low);
  void initial(ObjectRef ref, const Section& section, const Keys& keys, od::SubSpec& spec);
  void extras(ObjectRef ref, const Section& section, const Keys& keys);
  void check_limits(const Section& section, const Entry* entry, const od::SubSpec& spec, const od::Literal& value);
  [[nodiscard]] std::optional<od::Literal> literal(const Section& section, const Entry* entry, od::DataType type);
  /// False (and one error) when the file asks for more than `ReadOptions` allows.
  bool afford(const Section* section, std::size_t sub_objects, std::size_t bytes);
  void add(std::uint16_t index, const od::SubSpec& spec, const Section* section);

  /// @name Modules (modules_read.cpp)
  /// @{
  void modules(File& file);
  [[nodiscard]] Module module(std::uint16_t number, std::span<const ModuleSection> sections);
  void fixed_object(Module& module, std::span<const ModuleSection> sections);
  void extension(Module& module, std::span<const ModuleSection> sections);
  [[nodiscard]] ModuleValue module_value(std::uint16_t index, const Section& section, const Keys& keys,
                                         const Fallback& fallback);
  void check_module_list(const Section& section, std::span<const std::uint16_t> present);
  /// @}

  void compact_pdos();
  void compact_pdo(std::uint16_t communication, std::uint16_t mapping, unsigned number, bool receive);
  void check_pdo_counts(const od::Description& description);
  void check_mandatory(const od::Description& description);

  [[nodiscard]] const Entry* entry(const Keys& keys, Key key) const noexcept {
    return keys[static_cast<std::size_t>(key)];
  }
  [[nodiscard]] bool given(const Keys& keys, Key key) const noexcept { return !context_.raw(entry(keys, key)).empty(); }

  Context& context_;
  const DeviceInfo& device_;
  const ReadOptions& options_;
  od::DescriptionBuilder builder_;
  std::vector<ObjectSection> sections_;
  /// One bit for each index: it is in a list; its section was read.
  using Indices = std::array<std::uint64_t, 0x10000 / 64>;
  static std::uint64_t bit(std::uint64_t index) noexcept { return 1ULL << (index % 64); }
  struct Listed {
    const Section* section;
    const Entry* entry;
    std::uint16_t index;
  };
  std::unique_ptr<Indices> listed_ = std::make_unique<Indices>();
  std::vector<Listed> lists_;  // what the object lists name, in the order of the file
  std::unique_ptr<Indices> described_ = std::make_unique<Indices>();
  bool any_list_ = false;
  bool dcf_ = false;
  std::string scratch_;  ///< holds a name until the builder has copied it
  std::size_t sub_objects_ = 0;
  std::size_t bytes_ = 0;
  bool too_much_ = false;
  std::vector<Parameter> parameters_;
  std::vector<FileReference> file_references_;
  std::vector<Parameter> defaults_;
  std::size_t parameters_of_group_ = 0;  ///< how many there were before the group that is being read
  std::vector<Denotation> denotations_;
  std::vector<ParamRef> param_refs_;
  std::vector<ObjectLinks> object_links_;
};

template <class F>
void ObjectReader::numbered(const Section& section, const char* counter, F&& each) {
  std::optional<std::uint64_t> promised;
  std::size_t found = 0;
  for (const Entry& entry : context_.document().entries(section)) {
    const std::string_view key = context_.document().key(entry);
    if (same_word(key, counter)) {
      promised = context_.number(section, &entry, 0xFFFF'FFFF, Finding::Severity::warning);
      continue;
    }
    const auto number = number_key(key);
    if (!number) {
      context_.warn(section, &entry, fmt::format("neither {} nor a number; left out", counter));
      continue;
    }
    if (context_.raw(&entry).empty()) continue;
    ++found;
    each(*number, entry);
  }
  if (!promised) {
    context_.warn(section, nullptr, fmt::format("{} is missing; {} entries stand there", counter, found));
  } else if (*promised != found) {
    context_.warn(section, nullptr, fmt::format("{} says {}, {} stand there", counter, *promised, found));
  }
}

}  // namespace berth::eds
