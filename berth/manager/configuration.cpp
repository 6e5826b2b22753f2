#include "berth/manager/configuration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <set>

#include "berth/base/bytes.hpp"
#include "berth/base/read_files.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/dcf.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/manager/object_ranges_parts.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::manager {
namespace {

constexpr std::uint32_t ms_of_a_day = 86'400'000;
constexpr std::uint16_t date_object = 0x1020;
constexpr std::uint16_t identity_object = 0x1018;
constexpr std::size_t longest_file = std::size_t{64} << 20U;

bool is_communication(std::uint16_t index) noexcept { return within(index, 0x1000, 0x1FFF); }

std::string name_of(const od::Description& description, ObjectRef ref) {
  const auto* const object = description.find(ref.index);
  const auto* const sub = object != nullptr ? description.find(*object, ref.sub) : nullptr;
  if (sub == nullptr) return {};
  const std::string own(description.name(*sub));
  // The name "Consumer heartbeat time 1" contains the object's name already.
  if (object->count == 1 || own.starts_with(description.name(*object))) return own;
  return fmt::format("{}: {}", description.name(*object), own);
}

std::int64_t days_of(std::chrono::year_month_day date) {
  using namespace std::chrono;
  return (sys_days(date) - sys_days(year(1984) / January / 1)).count();
}

/// "01-15-2025" (month, day, year); 0 when it is no date after 1984-01-01.
std::uint32_t days_of(std::string_view text) {
  using namespace std::chrono;
  if (text.size() != 10) return 0;
  const auto part = [&](std::size_t at, std::size_t count) {
    unsigned value = 0;
    const auto* const first = text.data() + at;
    const auto [end, error] = std::from_chars(first, first + count, value);
    return error == std::errc{} && end == first + count ? value : 0U;
  };
  const year_month_day date{year(static_cast<int>(part(6, 4))), month(part(0, 2)), day(part(3, 2))};
  const auto days = date.ok() ? days_of(date) : 0;
  return days > 0 && days <= 0xFFFF ? static_cast<std::uint32_t>(days) : 0U;
}

class Loader {
 public:
  explicit Loader(const std::filesystem::path& path) : path_(path) { result_.configuration.file = path.string(); }

  LoadedConfiguration load() {
    auto extension = path_.extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    const bool described = extension == ".dcf" || extension == ".eds" || extension == ".xdc" || extension == ".xdd";
    if (described) {
      description(eds::read_any_file(path_));
    } else {
      concise_file();
    }
    return finished();
  }
  LoadedConfiguration load_text(std::string text) {
    has_folder_ = false;
    description(eds::read_any(std::move(text), path_.string()));
    return finished();
  }
  LoadedConfiguration load_concise(std::span<const std::uint8_t> stream) {
    concise(stream);
    return finished();
  }

 private:
  LoadedConfiguration finished() {
    auto& settings = result_.configuration.settings;
    std::ranges::sort(settings, {}, &Setting::object);
    if (settings.empty() && result_.usable()) {
      error("it sets no value", "give objects a ParameterValue, or leave config out of the slot");
    }
    return std::move(result_);
  }

  void error(std::string message, std::string fix, std::uint32_t line = 0, std::string key = {}) {
    result_.findings.push_back({Finding::Severity::error, path_.string(), static_cast<int>(line), line != 0 ? 1 : 0,
                                std::move(key), std::move(message), std::move(fix)});
  }

  void description(const eds::Reading& reading) {
    std::ranges::copy_if(reading.findings, std::back_inserter(result_.findings),
                         [](const Finding& f) { return f.severity == Finding::Severity::error; });
    if (!reading.usable()) return;
    const auto& file = reading.file;
    auto& c = result_.configuration;
    c.type = file.type_code();
    c.revision = file.revision();
    if (const auto* const type = file.description->find(ObjectRef{0x1000, 0}))
      c.device_type = static_cast<std::uint32_t>(file.description->default_of(*type).resolve(type->type, 0));
    if (file.commissioning) c.node_id = file.commissioning->node_id;
    c.modified = days_of(file.info.modification_date);
    if (c.modified == 0) c.modified = days_of(file.info.creation_date);
    for (const auto& p : file.parameters) take(*file.description, p.object, p.type, p.value, p.line);
    for (const auto& f : file.file_references) {
      if (f.download) take_file(*file.description, f);
    }
    complete(*file.description);
  }

  void take(const od::Description& description, ObjectRef object, od::DataType type, const od::Literal& value,
            std::uint32_t line) {
    if (object.index == date_object) return take_date(object.sub, value.resolve(type, 0));
    const auto* const sub = description.find(object);
    if (sub == nullptr || is_left_alone(object.index) || !value.present()) return;
    const bool refused = (sub->obj_flags & od::refuse_write_on_download) != 0 ||
                         ((description.find(object.index)->obj_flags & od::refuse_write_on_download) != 0);
    const bool compare_only = refused || !od::writable(sub->access);
    // A measured value need not be equal to the one that was read into the file.
    if (compare_only && !is_communication(object.index) && sub->access != od::Access::constant && sub->mappable) return;
    // The serial number is the device's own, and the rest of the identity was checked before.
    if (object.index == identity_object) return;
    result_.configuration.settings.push_back({object, type, value, name_of(description, object), line, compare_only});
  }

  void take_date(std::uint8_t sub, std::uint64_t value) {
    auto& date = result_.configuration.date;
    if (sub == 1) date.days = static_cast<std::uint32_t>(value);
    if (sub == 2) date.ms = static_cast<std::uint32_t>(value);
  }

  void take_file(const od::Description& description, const eds::FileReference& reference) {
    if (is_left_alone(reference.object.index)) return;
    if (!has_folder_) {
      return error(fmt::format("{} is not part of the text", reference.name), "give the value itself", reference.line,
                   fmt::format("[{:04X}sub{:X}] DownloadFile", reference.object.index, reference.object.sub));
    }
    auto bytes = eds::read_beside(path_, reference);
    if (!bytes) {
      return error(fmt::format("{} cannot be read: {}", reference.name, describe(bytes.error())),
                   "put it beside the DCF", reference.line,
                   fmt::format("[{:04X}sub{:X}] DownloadFile", reference.object.index, reference.object.sub));
    }
    take(description, reference.object, od::DataType::domain, od::Literal::octets(*bytes), reference.line);
  }

  [[nodiscard]] bool sets(ObjectRef object) const {
    return std::ranges::find(result_.configuration.settings, object, &Setting::object) !=
           result_.configuration.settings.end();
  }

  // Adds COB-IDs that must be switched off while a configuration is written.
  void complete(const od::Description& description) {
    std::map<ObjectRef, std::uint32_t> ids;  // with the line of the setting that needs them
    for (const auto& s : result_.configuration.settings) {
      if (s.compare_only) continue;
      const std::uint16_t index = s.object.index;
      if (od::is_pdo_record(index)) ids.try_emplace({od::communication_of(index), 1}, s.line);
      if (!od::cia301::is_additional_channel(index)) continue;
      ids.try_emplace({index, 1}, s.line);
      ids.try_emplace({index, 2}, s.line);
    }
    for (const auto& [object, line] : ids) {
      const auto* const sub = description.find(object);
      if (sub == nullptr || sets(object) || !sub->has_default || !od::writable(sub->access)) continue;
      take(description, object, sub->type, description.default_of(*sub), line);
    }
  }

  void concise_file() {
    std::error_code code;
    const auto size = std::filesystem::is_regular_file(path_, code) ? std::filesystem::file_size(path_, code) : 0;
    if (size > longest_file) return error("the file is longer than 64 MiB", "name a concise DCF");
    std::vector<std::uint8_t> bytes(size);
    note_read(path_);
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(path_.c_str(), "rb"), std::fclose);
    const bool is_file = !code && std::filesystem::is_regular_file(path_, code) && in != nullptr;
    if (!is_file || std::fread(bytes.data(), 1, bytes.size(), in.get()) != bytes.size()) {
      return error("the file cannot be read", "name a DCF, an XDC or a concise DCF");
    }
    concise(bytes);
  }

  void concise(std::span<const std::uint8_t> stream) {
    const auto dcf = eds::decode_concise_dcf(stream);
    if (!dcf) {
      return error(fmt::format("this is not a concise DCF: {} (byte {})", dcf.error().text, dcf.error().detail),
                   "a DCF in text is named *.dcf");
    }
    std::map<ObjectRef, Setting> settings;
    for (const auto& entry : dcf->entries) take_concise(entry, settings);
    for (auto& [object, setting] : settings) result_.configuration.settings.push_back(std::move(setting));
  }

  // A stream is a list of downloads; the last write of an object counts. A PDO's COB-ID is invalidated first and set
  // last, its mapping emptied first and counted last, so this is right for these too.
  void take_concise(const eds::ConciseEntry& entry, std::map<ObjectRef, Setting>& settings) {
    const ObjectRef object = entry.object;
    std::uint64_t value = 0;
    for (std::size_t i = std::min<std::size_t>(entry.data.size(), 8); i-- > 0;) value = value << 8U | entry.data[i];
    if (object.index == date_object) return take_date(object.sub, value);
    if (object.index == identity_object && object.sub == 1)
      result_.configuration.type.vendor = static_cast<std::uint32_t>(value);
    if (object.index == identity_object && object.sub == 2)
      result_.configuration.type.product = static_cast<std::uint32_t>(value);
    if (is_left_alone(object.index) || object.index == identity_object) return;
    Setting setting;
    setting.object = object;
    setting.value = od::Literal::octets(entry.data);
    settings[object] = std::move(setting);
  }

  const std::filesystem::path& path_;
  LoadedConfiguration result_;
  bool has_folder_ = true;
};

/// FNV-1a, 64 bit.
class Hash {
 public:
  void add(std::span<const std::uint8_t> bytes) noexcept {
    for (const auto byte : bytes) value_ = (value_ ^ byte) * 0x100'0000'01B3ULL;
  }
  void add(std::uint32_t number) noexcept {
    std::array<std::uint8_t, 4> bytes{};
    store_le(bytes.data(), number);
    add(std::span<const std::uint8_t>(bytes));
  }
  [[nodiscard]] std::uint64_t value() const noexcept { return value_; }

 private:
  std::uint64_t value_ = 0xCBF2'9CE4'8422'2325ULL;
};

ConfigurationDate date_of(std::span<const Entry> entries, std::uint32_t modified) {
  Hash hash;
  for (const auto& e : entries) {
    hash.add(e.object.index | std::uint32_t{e.object.sub} << 16U);
    hash.add(static_cast<std::uint32_t>(e.bytes.size()));
    hash.add(e.bytes);
  }
  constexpr std::uint32_t some_days = 15'000;  // from 1984 to 2025
  const auto days = modified != 0 ? modified : 1 + static_cast<std::uint32_t>((hash.value() >> 32U) % some_days);
  return {days, 1 + static_cast<std::uint32_t>(hash.value() % (ms_of_a_day - 1))};
}

bool is_mapping_entry(ObjectRef object) noexcept { return od::is_pdo_mapping(object.index) && object.sub != 0; }

/// FEh and FFh are not numbers of entries but kinds of MPDO.
void drop_unused_mapping(std::vector<Entry>& entries) {
  std::map<std::uint16_t, std::uint8_t> counts;
  for (const auto& e : entries) {
    const bool counts_entries = is_mapping_entry({e.object.index, 1}) && e.object.sub == 0 && e.bytes.size() == 1;
    if (counts_entries && e.bytes[0] < 0xFE) counts[e.object.index] = e.bytes[0];
  }
  std::erase_if(entries, [&](const Entry& e) {
    const auto count = counts.find(e.object.index);
    return is_mapping_entry(e.object) && count != counts.end() && e.object.sub > count->second;
  });
}

}  // namespace

std::string to_string(const ConfigurationDate& date) {
  using namespace std::chrono;
  const year_month_day day{sys_days(year(1984) / January / 1) + days(date.days)};
  const hh_mm_ss time{milliseconds(date.ms)};
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}.{:03}", static_cast<int>(day.year()),
                     static_cast<unsigned>(day.month()), static_cast<unsigned>(day.day()), time.hours().count(),
                     time.minutes().count(), time.seconds().count(), time.subseconds().count());
}

LoadedConfiguration load_configuration(const std::filesystem::path& path) { return Loader(path).load(); }

LoadedConfiguration read_configuration(std::string text, const std::string& name) {
  const std::filesystem::path path(name);
  return Loader(path).load_text(std::move(text));
}

LoadedConfiguration read_concise_configuration(std::span<const std::uint8_t> stream, const std::string& name) {
  const std::filesystem::path path(name);
  return Loader(path).load_concise(stream);
}

Configuration joined(const Configuration& base, const Configuration& over) {
  Configuration all = base;
  std::erase_if(all.settings, [&](const Setting& each) {
    return std::ranges::binary_search(over.settings, each.object, {}, &Setting::object);
  });
  for (Setting each : over.settings) {
    each.line = 0;  // the line is one of another file
    all.settings.push_back(std::move(each));
  }
  std::ranges::sort(all.settings, {}, &Setting::object);
  all.date = {};
  return all;
}

Result<Wanted> wanted(const Configuration& configuration, NodeId node, std::span<const Entry> own) {
  Wanted result;
  result.file = configuration.file;
  result.type = configuration.type;
  for (const auto& s : configuration.settings) {
    if (std::ranges::find(own, s.object, &Entry::object) != own.end()) continue;
    Entry entry{s.object, {}, s.type, s.name, s.line, s.compare_only, false};
    if (s.type == od::DataType::none) {
      entry.bytes = s.value.bytes;
    } else {
      auto bytes = eds::encode(s.value, s.type, node);
      if (!bytes) {
        auto error = bytes.error();
        error.index = s.object.index;
        error.sub = s.object.sub;
        return fail(error);
      }
      entry.bytes = std::move(*bytes);
    }
    result.entries.push_back(std::move(entry));
  }
  for (const auto& entry : own) {
    result.entries.push_back(entry);
    result.entries.back().own = true;
  }
  std::ranges::sort(result.entries, {}, &Entry::object);
  drop_unused_mapping(result.entries);
  result.date = configuration.date.valid() ? configuration.date : date_of(result.entries, configuration.modified);
  return result;
}

std::string print_value(od::DataType type, std::span<const std::uint8_t> bytes) {
  constexpr std::size_t longest = 24;
  const bool number = od::is_integer(type) && bytes.size() == od::byte_size(type);
  if (number) {
    const auto text = od::print(type, bytes);
    const auto raw = od::load(type, bytes.data());
    const bool small = raw < 10 || od::is_signed(type) || type == od::DataType::boolean;
    if (small) return text;
    // In decimal, COB-IDs and mapping entries are unreadable.
    return raw > 0xFF'FFFF ? fmt::format("0x{:X}", raw) : fmt::format("{} (0x{:X})", text, raw);
  }
  const bool text = type == od::DataType::visible_string;
  const bool cut = bytes.size() > longest;
  const auto shown = cut ? bytes.first(longest) : bytes;
  const bool scalar = od::byte_size(type) != 0 && bytes.size() == od::byte_size(type);
  if (scalar) return od::print(type, bytes);
  if (text) return fmt::format("\"{}\"{}", od::print(type, shown), cut ? "..." : "");
  if (bytes.empty()) return "nothing";
  std::string hex;
  for (const auto byte : shown) hex += fmt::format("{}{:02X}", hex.empty() ? "" : " ", byte);
  return cut ? fmt::format("{} ... ({} bytes)", hex, bytes.size()) : hex;
}

}  // namespace berth::manager
