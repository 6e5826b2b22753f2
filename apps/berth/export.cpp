// `berth export` and `berth import`: a machine's files and its slot table as one file, for another computer. The file
// is JSON: {"berth_export": 1, "machine": "conveyor.toml", "files": [{"name", "base64"}], "store": {"name", "base64"}}.
// Names are relative to the machine file's folder and stay beneath it.
#include <fmt/format.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "adopt.hpp"
#include "berth/base/base64.hpp"
#include "berth/command/notes.hpp"
#include "berth/store/database.hpp"
#include "berth/text/file.hpp"
#include "berth/text/printable.hpp"
#include "interrupt.hpp"
#include "machine_file.hpp"
#include "slot_table.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int export_version = 1;

std::string coded(std::string_view bytes) {
  return to_base64({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

tl::expected<std::string, Failure> bytes_of_file(const std::string& path) {
  Findings findings;
  auto text = text::read_file(path, findings);
  if (!text) return tl::unexpected(failure(findings));
  return std::move(*text);
}

// Does the name stay beneath its folder, and is it what it looks like? No hidden file (a shell or a tool might read
// it), and no characters that a terminal does not show.
bool is_safe(const std::string& name) {
  constexpr std::size_t longest = 200;
  const fs::path path(name);
  if (name.empty() || name.size() > longest || path.is_absolute() || !path.has_filename()) return false;
  if (name.find("//") != std::string::npos) return false;
  if (!text::is_printable(name) || name.find_first_of("\n\t\\") != std::string::npos) return false;
  return std::ranges::none_of(path, [](const fs::path& part) { return part.empty() || part.native().front() == '.'; });
}

/// The machine file, the files that it names, and the notes beside them; paths relative to the machine file's folder.
tl::expected<std::vector<std::string>, Failure> files_of(const design::Machine& machine) {
  const fs::path folder = fs::path(machine.file).parent_path();
  std::vector<std::string> names{fs::path(machine.file).filename().string()};
  std::set<std::string> seen;
  for (const auto& slot : machine.slots) {
    seen.insert(slot.eds_path);
    seen.insert(slot.spec.config);
  }
  for (const auto& device : machine.library) {
    seen.insert(device.eds_path);
    if (device.file != machine.file) seen.insert(device.file);
  }
  seen.erase("");
  for (const std::string& path : std::set(seen)) {
    std::error_code none;
    const std::string notes = command::notes_file(path);  // the user's notes on it, if there are any
    if (fs::is_regular_file(notes, none)) seen.insert(notes);
  }
  for (const auto& path : seen) {
    const std::string name = fs::path(path).lexically_relative(folder.empty() ? fs::path(".") : folder).string();
    const std::string inside = folder.empty() ? fs::path(path).lexically_normal().string() : name;
    if (!is_safe(inside)) {
      return tl::unexpected(failure(
          Exit::no, path + ": lies outside of the machine file's folder or is hidden, and an import would not put it "
                           "there; move it beneath that folder under a plain name"));
    }
    if (std::ranges::find(names, inside) == names.end()) names.push_back(inside);
  }
  return names;
}

// SQLite's data is in one file only if no process has the store open. So open it, which takes its lock, and close it,
// which writes the write-ahead log into the file.
tl::expected<std::string, Failure> store_bytes(const std::string& path) {
  {
    const Interrupt interrupt;
    const auto opened = store::Database::open(path, {.ended = ended_by({})});
    if (!opened) return tl::unexpected(failure(Exit::failed, opened.error().message));
  }
  std::error_code ignored;
  if (fs::exists(path + "-wal") && fs::file_size(path + "-wal", ignored) > 0) {
    return tl::unexpected(failure(Exit::failed, path + ": another process uses it; end it, then export"));
  }
  return bytes_of_file(path);
}

/// A file of an export, decoded.
struct Content {
  std::string name;
  std::string bytes;
};

tl::expected<Content, Failure> content_of(const Json& entry, const std::string& from) {
  const bool shaped = entry.is_object() && entry.contains("name") && entry.at("name").is_string() &&
                      entry.contains("base64") && entry.at("base64").is_string();
  if (!shaped) return tl::unexpected(failure(Exit::usage, from + ": a file in it has no name or no content"));
  const auto name = entry.at("name").get<std::string>();
  if (!is_safe(name)) {
    return tl::unexpected(
        failure(Exit::usage, fmt::format("{}: \"{}\" is not a plain name beneath a folder", from, name)));
  }
  auto bytes = from_base64(entry.at("base64").get<std::string>());
  if (!bytes) return tl::unexpected(failure(Exit::usage, fmt::format("{}: {} is damaged", from, name)));
  return Content{name, std::string(bytes->begin(), bytes->end())};
}

// Finds text with deeper nesting or more values than any export has: a JSON reader would need a hundred times its size.
std::optional<std::size_t> beyond_an_export(std::string_view text) {
  constexpr unsigned deepest = 8;
  constexpr unsigned most_values = 100'000;
  unsigned depth = 0;
  unsigned values = 0;
  bool quoted = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (quoted && c == '\\') ++at;
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    const bool opens = c == '[' || c == '{';
    if (opens && ++depth > deepest) return at;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if ((opens || c == ',') && ++values > most_values) return at;
  }
  return std::nullopt;
}

tl::expected<std::vector<Content>, Failure> contents_of(const std::string& text, const std::string& from) {
  if (const auto at = beyond_an_export(text)) {
    return tl::unexpected(failure(
        Exit::usage, fmt::format("{}: this is not an export of Berth: too many values, at byte {}", from, *at)));
  }
  const auto json = Json::parse(text, nullptr, false);
  const bool ours = json.is_object() && json.contains("berth_export") && json.at("berth_export").is_number_integer() &&
                    json.contains("files") && json.at("files").is_array();
  if (!ours) return tl::unexpected(failure(Exit::usage, from + ": this is not an export of Berth"));
  const auto version = json.at("berth_export").get<std::int64_t>();
  if (version != export_version) {
    return tl::unexpected(failure(Exit::usage, fmt::format("{}: it is of version {}, and this Berth reads version {}",
                                                           from, version, export_version)));
  }
  std::vector<Content> all;
  for (const auto& entry : json.at("files")) {
    auto content = content_of(entry, from);
    if (!content) return tl::unexpected(content.error());
    all.push_back(std::move(*content));
  }
  if (json.contains("store") && !json.at("store").is_null()) {
    auto content = content_of(json.at("store"), from);
    if (!content) return tl::unexpected(content.error());
    const Interrupt interrupt;
    const auto seen = store::look(content->bytes, from + ", " + content->name, {.ended = ended_by({})});
    if (!seen) return tl::unexpected(failure(Exit::usage, seen.error().message));
    all.push_back(std::move(*content));
  }
  std::set<std::string> names;
  for (const auto& content : all) {
    if (names.insert(content.name).second) continue;
    return tl::unexpected(failure(Exit::usage, fmt::format("{}: {} is in it twice", from, content.name)));
  }
  for (const auto& name : names) {
    for (auto folder = fs::path(name).parent_path(); !folder.empty(); folder = folder.parent_path()) {
      if (!names.contains(folder.string())) continue;
      return tl::unexpected(
          failure(Exit::usage, fmt::format("{}: {} is a file and a folder in it", from, folder.string())));
    }
  }
  return all;
}

/// The files that an import has made so far. If they are not kept, they are removed, and nothing else is.
class Written {
 public:
  Written() = default;
  ~Written() {
    if (kept_) return;
    for (auto path = made_.rbegin(); path != made_.rend(); ++path) ::remove(path->c_str());
  }
  Written(const Written&) = delete;
  Written& operator=(const Written&) = delete;

  std::optional<Failure> folder(const fs::path& path) {
    std::error_code ignored;
    if (path.empty() || fs::is_directory(path, ignored)) return std::nullopt;
    if (auto wrong = folder(path.parent_path())) return wrong;
    if (::mkdir(path.c_str(), 0777) != 0) return failure(Exit::failed, path.string() + ": " + std::strerror(errno));
    made_.push_back(path);
    return std::nullopt;
  }
  std::optional<Failure> file(const fs::path& path, std::string_view bytes) {
    if (auto wrong = folder(path.parent_path())) return wrong;
    if (auto wrong = write_whole({{path.string(), bytes}}, false)) return wrong;
    made_.push_back(path);
    return std::nullopt;
  }
  void keep() noexcept { kept_ = true; }

 private:
  std::vector<fs::path> made_;
  bool kept_ = false;
};

// What prevents making this name beneath the folder: the file exists, or a part of its path is no folder (a link may
// lead elsewhere).
std::string in_the_way(const fs::path& base, const std::string& name) {
  fs::path path = base;
  for (const auto& part : fs::path(name)) {
    path /= part;
    std::error_code ignored;
    const auto status = fs::symlink_status(path, ignored);
    const bool last = path == base / name;
    if (fs::exists(status) && (last || !fs::is_directory(status))) return "  " + path.string();
  }
  return {};
}

}  // namespace

int run_export(const Options& given, const std::string& to) {
  Options options = given;
  options.machine = default_machine(given);
  if (options.machine.empty()) {
    return tell(failure(Exit::usage, "of which machine? Name its file: berth export machine.toml " + to), options.json);
  }
  auto loaded = design::load_machine(options.machine, options.files.allow_outside);
  if (!loaded.machine) return tell(failure(loaded.findings), options.json);
  const auto names = files_of(*loaded.machine);
  if (!names) return tell(names.error(), options.json);
  Json all{{"berth_export", export_version}, {"machine", names->front()}, {"name", loaded.machine->name}};
  all["files"] = Json::array();
  const fs::path folder = fs::path(options.machine).parent_path();
  for (const auto& name : *names) {
    const auto bytes = bytes_of_file((folder / name).string());
    if (!bytes) return tell(bytes.error(), options.json);
    all["files"].push_back({{"name", name}, {"base64", coded(*bytes)}});
  }
  const std::string store = options.store.file.empty() ? default_store(options.machine) : options.store.file;
  all["store"] = nullptr;
  const bool has_store = fs::exists(store);
  if (!has_store && !options.store.file.empty()) {
    return tell(failure(Exit::failed, store + ": there is no such slot table"), options.json);
  }
  if (has_store) {
    const auto bytes = store_bytes(store);
    if (!bytes) return tell(bytes.error(), options.json);
    const std::string name = fs::path(default_store(names->front())).filename().string();
    all["store"] = {{"name", name}, {"base64", coded(*bytes)}};
  }
  const std::string written = all.dump(1) + "\n";
  if (const auto wrong = write_whole({{to, written}}, false)) return tell(*wrong, options.json);
  if (options.json) {
    print_text(Json{{"export", to}, {"files", names->size()}, {"store", has_store}}.dump(2));
  } else {
    print_line(fmt::format("{}: {} file{}{}", to, names->size(), names->size() == 1 ? "" : "s",
                           has_store ? " and the slot table" : "; there is no slot table (" + store + ")"));
  }
  return Exit::done;
}

int run_import(const Options& options, const std::string& from, const std::string& folder) {
  const auto text = bytes_of_file(from);
  if (!text) return tell(text.error(), options.json);
  const auto contents = contents_of(*text, from);
  if (!contents) return tell(contents.error(), options.json);
  const fs::path base(folder.empty() ? "." : folder);
  std::vector<std::string> there{"import overwrites nothing, and these files are there already:"};
  for (const auto& content : *contents) {
    if (auto path = in_the_way(base, content.name); !path.empty()) there.push_back(std::move(path));
  }
  if (there.size() > 1) return tell(failure_in_lines(Exit::no, there), options.json);
  Json written = Json::array();
  Written made;
  for (const auto& content : *contents) {
    const fs::path path = base / content.name;
    if (const auto wrong = made.file(path, content.bytes)) return tell(*wrong, options.json);
    written.push_back(path.string());
  }
  made.keep();
  if (!options.json) {
    for (const auto& path : written) print_line(path.get<std::string>());
  }
  if (options.json) print_text(Json{{"written", written}}.dump(2));
  return Exit::done;
}

}  // namespace berth::cli
