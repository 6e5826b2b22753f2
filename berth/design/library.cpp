#include "berth/design/library.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/design/read_parts.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/reach.hpp"

namespace berth::design {
namespace {

using places::Recipe;
using std::string_view;
using text::Limits;
using text::Table;
using text::Value;

constexpr std::array<string_view, 3> after_words{"reset-node", "reset-communication", "power-cycle"};
constexpr string_view id_word = "{id}";

class LibraryReader {
 public:
  LibraryReader(const std::string& file, const text::Reach& reach, const TypeLoader& loader, Findings& findings)
      : file_(file), reach_(reach), loader_(loader), findings_(findings) {}

  Library read(Table& root) {
    for (auto& table : root.tables("device-type")) read_device(table);
    return std::move(library_);
  }

 private:
  void read_device(Table& table) {
    KnownDevice device;
    device.file = file_;
    device.place = table.begin();
    if (table.require("name", "give the device type a name")) device.name = table.string("name").value_or("");
    const bool taken = std::ranges::find(library_, device.name, &KnownDevice::name) != library_.end();
    if (taken && !device.name.empty()) {
      table.error("name", fmt::format("the name {} is taken", text::quoted(device.name)),
                  "names are unique in a library");
    }
    read_type(table, device);
    if (auto recipe = table.table("recipe")) read_recipe(*recipe, device);
    table.finish();
    library_.push_back(std::move(device));
  }

  void read_type(Table& table, KnownDevice& device) {
    const bool has_type = table.has("type");
    const bool has_eds = table.has("eds");
    if (has_type == has_eds) {
      table.error(has_eds ? "eds" : "type",
                  has_type ? "type and eds exclude each other" : "the device type has no type code",
                  has_type ? "keep one of them" : "write type = { vendor = …, product = … } or eds = \"…\"");
    }
    if (auto type = table.table("type")) {
      if (type->require("vendor", "vendor-ID, 1018h:01")) device.type.vendor = type->u32("vendor").value_or(0);
      if (!type->has("product")) device.unasked = 2;
      device.type.product = type->u32("product").value_or(0);
      device.revision = type->u32("revision");
      type->finish();
    }
    if (has_eds) read_eds(table, device);
  }

  void read_eds(Table& table, KnownDevice& device) {
    device.eds = table.string("eds").value_or("");
    if (device.eds.empty()) return table.error("eds", "the file name is empty", "name a device description");
    device.eds_path = reach_.path(table, "eds", device.eds);
    if (device.eds_path.empty()) return;
    Findings said;
    const auto type = loader_ ? loader_(device.eds_path, said) : std::nullopt;
    if (!type && loader_ && !text::Reach::there(table, "eds", device.eds_path)) return;
    std::ranges::copy_if(said, std::back_inserter(findings_),
                         [](const Finding& f) { return f.severity == Finding::Severity::error; });
    if (!type) {
      return table.error("eds", fmt::format("{} cannot be used as a device description", text::quoted(device.eds_path)),
                         loader_ ? "see the messages about that file" : "write type = { … } instead");
    }
    device.type = type->type;
    device.revision = type->revision;
    device.unasked = type->unasked;
    device.description = type->description;
  }

  static void read_recipe(Table& table, KnownDevice& device) {
    auto recipe = std::make_shared<Recipe>();
    recipe->name = device.name;
    if (table.require("from", "the node-IDs that such devices leave the factory with, such as [1]")) {
      const auto from = table.integers("from", node_ids);
      if (from && from->empty()) table.error("from", "the list is empty", "such as [1]");
      for (const auto id : from.value_or(std::vector<std::int64_t>{})) {
        recipe->from.emplace_back(static_cast<std::uint8_t>(id));
      }
    }
    if (const auto after = table.word("then", after_words)) recipe->after = static_cast<Recipe::After>(*after);
    if (table.require("write", "the objects to write, such as [{ object = \"2000h:00\", value = \"{id}\" }]")) {
      for (auto& entry : table.tables("write")) {
        if (const auto write = read_write(entry)) recipe->writes.push_back(*write);
      }
      if (std::ranges::none_of(recipe->writes, &Recipe::Write::node_id)) {
        table.error("write", "no object gets the node-ID", "write value = \"{id}\" for one of them");
      }
    }
    table.finish();
    device.recipe = std::move(recipe);
  }

  static std::optional<Recipe::Write> read_write(Table& table) {
    Recipe::Write write;
    bool good =
        table.require("object", "such as \"2000h:00\"") && table.require("value", "a number, a text or \"{id}\"");
    if (!good) return std::nullopt;
    if (const auto object = table.string("object")) good = read_object(table, *object, write);
    const auto size = table.integer("size", {1, 8});
    read_value(table, write, size);
    table.finish();
    return good ? std::optional(write) : std::nullopt;
  }

  static bool read_object(Table& table, const std::string& object, Recipe::Write& write) {
    const auto ref = od::read_object(object);
    if (!ref) {
      table.error("object", ref.error().why, "such as \"2000h:00\"");
      return false;
    }
    write.index = ref->index;
    write.sub = ref->sub.value_or(0);
    return true;
  }

  // A text becomes its bytes in their order ("save" is 65766173h), as in signatures.
  static void read_value(Table& table, Recipe::Write& write, std::optional<std::int64_t> size) {
    const Value* value = table.get("value");
    if (value->kind == Value::Kind::integer) {
      write.value = static_cast<std::uint64_t>(value->integer);
      if (!size) return table.error("value", "the number's length is not known", "add size = 1, 2, 4 or 8 (bytes)");
      write.size = static_cast<std::uint8_t>(*size);
      const bool fits = value->integer >= 0 && (write.size == 8 || write.value >> (8U * write.size) == 0);
      if (!fits) table.error("value", fmt::format("{} does not fit {} bytes", value->integer, write.size), "");
      return;
    }
    const auto text = table.string("value");
    if (!text) return;
    write.node_id = *text == id_word;
    if (write.node_id) {
      write.size = static_cast<std::uint8_t>(size.value_or(1));
      return;
    }
    if (text->empty() || text->size() > 8 || (size && *size != std::ssize(*text))) {
      return table.error("value", fmt::format("{} needs 1 to 8 bytes, and as many as size says", text::quoted(*text)),
                         "write \"{id}\", a number, or a text such as \"save\"");
    }
    write.size = static_cast<std::uint8_t>(text->size());
    for (std::size_t i = 0; i < text->size(); ++i) {
      write.value |= static_cast<std::uint64_t>(static_cast<unsigned char>((*text)[i])) << (8 * i);
    }
  }

  const std::string& file_;
  const text::Reach& reach_;
  const TypeLoader& loader_;
  Findings& findings_;
  Library library_;
};

}  // namespace

Library read_device_types(text::Table& root, const std::string& file, const text::Reach& reach,
                          const TypeLoader& loader, Findings& findings) {
  return LibraryReader(file, reach, loader, findings).read(root);
}

Library read_library(std::string_view text, const std::string& file, const TypeLoader& loader,
                     std::span<const std::string> allowed, Findings& findings) {
  const auto root = text::parse_toml(text, file, findings);
  if (!root) return {};
  Table table(*root, "", file, findings);
  const text::Reach reach(file, allowed);
  auto library = read_device_types(table, file, reach, loader, findings);
  table.finish();
  return library;
}

}  // namespace berth::design
