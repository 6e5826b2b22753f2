#include "berth/eds/dcf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <map>
#include <memory>
#include <set>

#include "berth/base/read_files.hpp"
#include "berth/eds/copy.hpp"
#include "berth/eds/objects.hpp"
#include "berth/eds/write.hpp"

namespace berth::eds {
namespace {

tl::unexpected<Error> about(ObjectRef object, Errc code, const char* text) noexcept {
  return tl::unexpected<Error>(Error{.code = code, .sub = object.sub, .index = object.index, .text = text});
}
Result<void> with_object(Result<void> result, ObjectRef object) {
  if (result) return result;
  return about(object, result.error().code, result.error().text);
}

/// Why a file cannot hold a value as one of this type; null if it can.
const char* misfit(const od::Literal& value, od::DataType type) noexcept {
  using Kind = od::Literal::Kind;
  const bool scalar = od::byte_size(type) != 0;
  if (scalar != (value.kind != Kind::bytes)) return "the value is not one of the object's data type";
  if (!scalar) {
    if (value.bytes.empty()) return "a file cannot say that a value is empty";
    const bool odd = type == od::DataType::unicode_string && value.bytes.size() % 2 != 0;
    return odd ? "a UNICODE_STRING has an even number of bytes" : nullptr;
  }
  if (od::wrap(type, value.raw) != value.raw) return "the value is out of the range of the object's data type";
  const bool integer = od::is_integer(type) && type != od::DataType::boolean;
  if (value.kind == Kind::node_id_plus && !integer) return "only an integer can depend on the node-ID";
  if (type == od::DataType::boolean && value.raw > 1) return "a BOOLEAN is 0 or 1";
  return nullptr;
}

class DcfMaker {
 public:
  explicit DcfMaker(const File& eds) : eds_(eds), document_(eds.document), editor_(eds.document) {
    for (const Section& each : document_.sections()) {
      const std::string_view name = document_.name(each);
      const auto found = object_section(name);
      if (!found) continue;
      indices_.insert(found->index);
      if (found->part == Part::object) objects_[{found->index, 0}] = name;
      if (found->part == Part::sub) subs_[{found->index, found->sub}] = name;
      if (found->part == Part::value) values_[found->index] = name;
      if (found->part == Part::denotation) denotations_[found->index] = name;
    }
  }

  Result<std::string> run(const Configuration& wanted) {
    if (const auto done = file_info(wanted); !done) return fail(done.error());
    if (wanted.commissioning) {
      if (const auto done = commissioning(*wanted.commissioning); !done) return fail(done.error());
    }
    for (const Parameter& each : wanted.parameters) {
      if (const auto done = parameter(each); !done) return fail(done.error());
    }
    for (const Denotation& each : wanted.denotations) {
      if (const auto done = denotation(each); !done) return fail(done.error());
    }
    for (const FileReference& each : wanted.file_references) {
      if (const auto done = file_reference(each); !done) return fail(done.error());
    }
    return editor_.text();
  }

 private:
  Result<void> file_info(const Configuration& wanted) {
    const bool has_last = !editor_.value("FileInfo", "LastEDS").value_or("").empty();
    const std::string& last = !wanted.last_eds.empty() || has_last ? wanted.last_eds : eds_.info.file_name;
    for (const auto& [key, value] :
         {std::pair("FileName", &wanted.file_name), std::pair("LastEDS", &last),
          std::pair("ModificationTime", &wanted.modification_time),
          std::pair("ModificationDate", &wanted.modification_date), std::pair("ModifiedBy", &wanted.modified_by)}) {
      if (value->empty()) continue;
      if (const auto done = editor_.set("FileInfo", key, *value); !done) return done;
    }
    return {};
  }

  /// Keeps the present text if it means the same number.
  Result<void> set_number(std::string_view section, std::string_view key, std::uint64_t value,
                          const std::string& text) {
    const auto present = od::parse_number(editor_.value(section, key).value_or(""));
    if (present && !present->negative && !present->node_id && present->magnitude == value) return {};
    return editor_.set(section, key, text);
  }

  Result<void> commissioning(const Commissioning& given) {
    constexpr std::string_view right = "DeviceComissioning";
    constexpr std::string_view wrong = "DeviceCommissioning";
    const std::string_view section = !editor_.has_section(right) && editor_.has_section(wrong) ? wrong : right;
    if (const auto done = editor_.add_section(section, "DeviceInfo"); !done) return done;
    const std::uint64_t node = given.node_id ? given.node_id->value() : 0;
    const auto text = [&](std::string_view key, const std::string& value, bool must) -> Result<void> {
      if (!must && value.empty()) {
        editor_.remove(section, key);
        return {};
      }
      return editor_.set(section, key, value);
    };
    const auto number = [&](std::string_view key, std::optional<std::uint64_t> value, bool must) -> Result<void> {
      if (!value) return text(key, "", must);
      return set_number(section, key, *value, std::to_string(*value));
    };
    Result<void> done = given.node_id ? set_number(section, "NodeID", node, fmt::format("0x{:02X}", node))
                                      : editor_.set(section, "NodeID", "");
    if (done) done = text("NodeName", given.node_name, true);
    if (done) done = number("Baudrate", given.baud_rate, true);
    if (done) done = number("NetNumber", given.net_number, true);
    if (done) done = text("NetworkName", given.network_name, true);
    if (done) done = number("CANopenManager", given.canopen_manager ? 1U : 0U, true);
    if (done) done = number("LSS_SerialNumber", given.lss_serial_number, false);
    if (done) done = text("NodeRefd", given.node_refd, false);
    if (done) done = text("NetRefd", given.net_refd, false);
    return done;
  }

  /// The section that holds the keys of a sub-object; "" if it has none of its own.
  Result<std::string> section_of(ObjectRef ref) {
    const od::Object* const object = eds_.description->find(ref.index);
    if (object == nullptr || eds_.description->find(*object, ref.sub) == nullptr) {
      return about(ref, Errc::not_found, "the EDS does not have the object");
    }
    if (!indices_.contains(ref.index)) {
      if (const auto done = describe(*object); !done) return fail(done.error());
    }
    if (const auto found = subs_.find(ref); found != subs_.end()) return std::string(found->second);
    const auto main = objects_.find({ref.index, 0});
    const bool single = ref.sub == 0 && object->code != od::ObjectCode::array &&
                        object->code != od::ObjectCode::record && object->code != od::ObjectCode::defstruct;
    if (single && main != objects_.end()) return std::string(main->second);
    return std::string();
  }

  /// Adds sections for an object that only CompactPDO describes.
  Result<void> describe(const od::Object& object) {
    od::DescriptionBuilder builder;
    copy_object(*eds_.description, object, builder);
    File one;
    one.description = builder.build();
    Report report("", 0);
    const Document made = Document::parse(write(one).text, report);
    for (const Section& section : made.sections()) {
      const auto found = object_section(made.name(section));
      if (!found) continue;
      const std::string name(made.name(section));
      if (const auto done = editor_.add_section(name); !done) return done;
      for (const Entry& each : made.entries(section)) {
        if (const auto done = editor_.set_raw(name, made.key(each), made.value(each)); !done) return done;
      }
      (found->part == Part::sub ? subs_ : objects_)[{found->index, found->sub}] = name;
    }
    indices_.insert(object.index);
    return add_to_list("OptionalObjects", "SupportedObjects", fmt::format("0x{:04X}", object.index));
  }

  Result<void> add_to_list(std::string_view section, std::string_view counter, const std::string& value) {
    std::uint64_t count = 0;
    if (const auto number = od::parse_number(editor_.value(section, counter).value_or(""))) count = number->magnitude;
    while (editor_.value(section, std::to_string(count + 1))) ++count;
    if (const auto done = set_number(section, counter, count + 1, std::to_string(count + 1)); !done) return done;
    return editor_.set(section, std::to_string(count + 1), value);
  }

  /// The name of the object's section [xxxxValue] or [xxxxDenotation], as in the file; otherwise the name to be
  /// written.
  std::string list_name(const std::map<std::uint16_t, std::string>& names, std::uint16_t index,
                        const char* word) const {
    const auto found = names.find(index);
    return found != names.end() ? found->second : fmt::format("{:04X}{}", index, word);
  }

  /// Sets or removes the entry of a number in a list with NrOfEntries.
  Result<void> list_entry(const std::string& section, std::uint16_t index, std::uint8_t sub,
                          const std::optional<std::string>& value, bool raw) {
    const std::string key = std::to_string(sub);
    const bool had = !editor_.value(section, key).value_or("").empty();
    if (!value && !had) return {};
    if (value) {
      const auto main = objects_.find({index, 0});
      const auto added = editor_.add_section(section, main == objects_.end() ? std::string() : main->second);
      if (!added) return added;
      if (!editor_.value(section, "NrOfEntries")) {
        if (const auto done = editor_.set(section, "NrOfEntries", "0"); !done) return done;
      }
      const auto done = raw ? editor_.set_raw(section, key, *value) : editor_.set(section, key, *value);
      if (!done) return done;
    } else {
      editor_.remove(section, key);
    }
    std::uint64_t count = 0;
    for (unsigned i = 0; i <= 0xFF; ++i) {
      if (!editor_.value(section, std::to_string(i)).value_or("").empty()) ++count;
    }
    return set_number(section, "NrOfEntries", count, std::to_string(count));
  }

  /// The text of a value, in the notation that the file uses for this object.
  std::string value_text(ObjectRef ref, const od::Literal& value, od::DataType type, const std::string& section) const {
    const auto main = objects_.find({ref.index, 0});
    const std::string& from = !section.empty() || main == objects_.end() ? section : main->second;
    std::string usual = editor_.value(from, "DefaultValue").value_or("");
    if (type != od::DataType::visible_string && !usual.empty()) {
      const auto parsed = od::parse(type, usual);
      if (parsed && parsed->value == value) return usual;
    }
    const bool hex = usual.empty() ? usually_hex(ref, type)
                                   : usual.find("0x") != std::string::npos || usual.find("0X") != std::string::npos;
    return text_of(value, type, hex);
  }

  bool says_already(const std::optional<std::string>& present, const od::Literal& value, od::DataType type) const {
    if (!present || present->empty() || type == od::DataType::visible_string) return false;
    const auto parsed = od::parse(type, *present);
    return parsed && parsed->value == value;
  }

  Result<void> parameter(const Parameter& wanted) {
    const ObjectRef ref = wanted.object;
    const auto section = section_of(ref);
    if (!section) return fail(section.error());
    const od::DataType type = eds_.description->find(ref)->type;
    const bool raw = type == od::DataType::visible_string;
    const std::string list = list_name(values_, ref.index, "Value");
    if (!wanted.value.present()) {
      if (!section->empty()) editor_.remove(*section, "ParameterValue");
      return with_object(list_entry(list, ref.index, ref.sub, std::nullopt, raw), ref);
    }
    if (const char* const why = misfit(wanted.value, type)) return about(ref, Errc::invalid, why);
    const std::string text = value_text(ref, wanted.value, type, *section);
    // A value list comes after the object's own section and overrides it.
    const bool in_list = section->empty() || editor_.value(list, std::to_string(ref.sub)).has_value();
    const std::string key = in_list ? std::to_string(ref.sub) : "ParameterValue";
    const std::string& place = in_list ? list : *section;
    if (says_already(editor_.value(place, key), wanted.value, type)) return {};
    if (in_list) return with_object(list_entry(list, ref.index, ref.sub, text, raw), ref);
    return with_object(raw ? editor_.set_raw(place, key, text) : editor_.set(place, key, text), ref);
  }

  Result<void> denotation(const Denotation& wanted) {
    const ObjectRef ref = wanted.object;
    const auto section = section_of(ref);
    if (!section) return fail(section.error());
    const std::string list = list_name(denotations_, ref.index, "Denotation");
    const bool in_list = section->empty() || editor_.value(list, std::to_string(ref.sub)).has_value();
    const auto text = wanted.text.empty() ? std::nullopt : std::optional(wanted.text);
    if (in_list) return with_object(list_entry(list, ref.index, ref.sub, text, false), ref);
    if (text) return with_object(editor_.set(*section, "Denotation", *text), ref);
    editor_.remove(*section, "Denotation");
    return {};
  }

  Result<void> file_reference(const FileReference& wanted) {
    const ObjectRef ref = wanted.object;
    const char* const key = wanted.download ? "DownloadFile" : "UploadFile";
    const auto section = section_of(ref);
    if (!section) return fail(section.error());
    if (section->empty()) return about(ref, Errc::invalid, "an object without a section of its own names no file");
    if (wanted.name.empty()) {
      editor_.remove(*section, key);
      return {};
    }
    if (!plain_file_name(wanted.name))
      return about(ref, Errc::invalid, "the file's name leads out of the DCF's folder");
    return with_object(editor_.set(*section, key, wanted.name), ref);
  }

  const File& eds_;
  const Document& document_;
  Editor editor_;
  std::set<std::uint16_t> indices_;  ///< indices of objects that have a section
  std::map<ObjectRef, std::string> objects_;
  std::map<ObjectRef, std::string> subs_;
  std::map<std::uint16_t, std::string> values_;
  std::map<std::uint16_t, std::string> denotations_;
};

}  // namespace

Result<std::string> make_dcf(const File& eds, const Configuration& configuration) {
  return DcfMaker(eds).run(configuration);
}

bool plain_file_name(std::string_view name) noexcept {
  const bool letters = std::ranges::all_of(
      name, [](char c) { return static_cast<unsigned char>(c) >= 0x20 && c != '/' && c != '\\' && c != ':'; });
  return letters && !name.empty() && name != "." && name != "..";
}

Result<std::vector<std::uint8_t>> read_beside(const std::filesystem::path& dcf, const FileReference& file,
                                              std::size_t max_bytes) {
  namespace fs = std::filesystem;
  const ObjectRef ref = file.object;
  if (!plain_file_name(file.name)) return about(ref, Errc::invalid, "the file's name leads out of the DCF's folder");
  std::error_code ec;
  const fs::path folder = fs::canonical(dcf.has_parent_path() ? dcf.parent_path() : fs::path("."), ec);
  if (ec) return about(ref, Errc::not_found, "the folder of the DCF is not there");
  const fs::path path = fs::canonical(folder / file.name, ec);
  if (ec) return about(ref, Errc::not_found, "the file that the DCF names is not there");
  if (path.parent_path() != folder)
    return about(ref, Errc::invalid, "the file is a link that leads out of the DCF's folder");
  if (!fs::is_regular_file(path, ec)) return about(ref, Errc::invalid, "what the DCF names is not a plain file");
  note_read(path.string());
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(path.c_str(), "rb"), &std::fclose);
  const auto failed = [ref](const char* text) {
    return tl::unexpected<Error>(Error{.code = Errc::io,
                                       .sub = ref.sub,
                                       .index = ref.index,
                                       .detail = static_cast<std::uint32_t>(errno),
                                       .text = text});
  };
  if (!in) return failed("opening the file that the DCF names");
  std::vector<std::uint8_t> bytes;
  std::size_t got = 1;
  while (got != 0 && bytes.size() <= max_bytes) {
    const std::size_t before = bytes.size();
    bytes.resize(before + (1U << 16U));
    got = std::fread(bytes.data() + before, 1, 1U << 16U, in.get());
    bytes.resize(before + got);
  }
  if (std::ferror(in.get()) != 0) return failed("reading the file that the DCF names");
  if (bytes.size() > max_bytes) return about(ref, Errc::invalid, "the file that the DCF names is too long");
  return bytes;
}

}  // namespace berth::eds
