// `berth backup save`, `compare`, `restore`: devices' values as dated DCFs, and back.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/manager/stored_dcf.hpp"
#include "request_verb.hpp"
#include "sdo.hpp"
#include "single.hpp"
#include "verbs.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

struct SaveOptions {
  std::shared_ptr<command::Request> request = std::make_shared<command::Request>(command::Request{"backup save", {}});
  std::vector<std::string> nodes;
  std::string folder = ".";
};

// "left-drive-2026-11-28-1605.dcf": only characters that every file system accepts.
std::string file_name(const Json& backup, bool several_buses) {
  std::string name = backup.contains("slot") ? backup.at("slot").get<std::string>()
                                             : fmt::format("node-{}", backup.at("node").get<unsigned>());
  if (several_buses) name = backup.at("bus").get<std::string>() + "-" + name;
  std::string clean;
  for (const char c : name) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                       static_cast<unsigned char>(c) >= 0x80;
    if (plain) {
      clean += c;
    } else if (!clean.empty() && !clean.ends_with('-')) {
      clean += '-';
    }
  }
  return fmt::format("{}-{:%Y-%m-%d-%H%M}.dcf", clean.empty() ? "device" : clean, fmt::localtime(std::time(nullptr)));
}

bool on_several_buses(const Json& backups) {
  for (const auto& each : backups) {
    if (each.at("bus") != backups.front().at("bus")) return true;
  }
  return false;
}

// Writes the received values, and puts the paths into `json`.
std::optional<Failure> write_backups(Json& json, const std::string& folder, bool force) {
  Json& backups = json.at("backups");
  const bool several = on_several_buses(backups);
  std::vector<std::string> texts, paths;
  for (auto& each : backups) {
    if (!each.contains("dcf")) continue;
    const auto text = manager::unpack_stored(manager::stored_format::zlib, bytes_of(each.at("dcf").get<std::string>()));
    if (!text) return failure(Exit::failed, "the answer has a DCF that cannot be unpacked");
    texts.push_back(*text);
    paths.push_back((fs::path(folder) / file_name(each, several)).string());
    each.erase("dcf");
    each["file"] = paths.back();
  }
  if (paths.empty()) return std::nullopt;
  std::error_code none;
  for (const auto& path : paths) {
    if (!force && fs::exists(fs::symlink_status(path, none)))
      return failure(Exit::no, path + ": is there already; --force replaces it, or name another folder by -o");
  }
  if (auto bad = make_folder(folder)) return bad;
  std::vector<WholeFile> files;
  for (std::size_t i = 0; i < paths.size(); ++i) files.push_back({paths[i], texts[i]});
  return write_whole(files, force);
}

int run_save(const Options& options, const SaveOptions& wanted) {
  command::Request request = *wanted.request;
  if (wanted.nodes.empty() && !request.arguments.contains("all")) {
    return tell(failure(Exit::usage, "which devices? Name them, or give --all"), options.json);
  }
  std::string nodes;
  for (const auto& node : wanted.nodes) nodes += (nodes.empty() ? "" : "\n") + node;
  if (!nodes.empty()) request.arguments["node"] = nodes;
  const auto reply = carry_out(options, request);
  if (!reply) return tell(reply.error(), options.json);
  if (reply->status > Exit::no) return tell({reply->status, reply->error, reply->json}, options.json);
  Json json = Json::parse(reply->json);
  if (!json.contains("backups")) return tell({reply->status, reply->error, reply->json}, options.json);
  if (const auto bad = write_backups(json, wanted.folder, options.files.force)) return tell(*bad, options.json);
  if (options.json) {
    print_text(json.dump(2));
    return reply->status;
  }
  print_lines(reply->lines);
  for (const auto& each : json.at("backups")) {
    if (each.contains("file")) print_line("wrote " + each.at("file").get<std::string>());
  }
  if (!reply->error.empty()) print_errors(reply->error);
  return reply->status;
}

// An absolute path, since another process may carry out the request in another folder.
std::string absolute_file(command::Request& request) {
  const auto file = request.arguments.find("file");
  if (file == request.arguments.end()) return "which DCF? Name its file";
  file->second = fs::absolute(file->second).string();
  return {};
}

void add_save(const Verb& backup, Options& options) {
  const auto wanted = std::make_shared<SaveOptions>();
  const Verb save =
      backup.add("save", help_of("backup save"), [&options, wanted] { return run_save(options, *wanted); });
  request_words(save, options, wanted->request, {.machine = {.confirms = false, .sends = false}});
  save.word("node", wanted->nodes, "node-IDs or slots' names").shown("NODE...");
  save.word("--output,-o", wanted->folder, "folder for the DCFs (default: this one)").shown("FOLDER");
  save.footer(
      "Examples:\n  berth backup save drive\n  berth backup save --all -o backups\nA DCF is named after its slot, with "
      "date and time.");
}

}  // namespace

void add_backup(Verb& berth, Options& options) {
  const Verb backup = berth.group("backup", "devices' values as DCFs: save, compare, restore, into a replacement too");
  backup.footer(
      "Examples:\n  berth backup save --all -o backups\n  berth backup compare drive "
      "backups/drive-2026-11-28-1605.dcf\n"
      "  berth backup restore drive backups/drive-2026-11-28-1605.dcf");
  add_save(backup, options);
  const RequestVerb compare(backup, options, "compare", "backup compare", absolute_file);
  compare.footer("Example:\n  berth backup compare drive drive-2026-11-28-1605.dcf");
  const RequestVerb restore(backup, options, "restore", "backup restore", absolute_file);
  restore.footer(
      "Example:\n  berth backup restore drive drive-2026-11-28-1605.dcf\nVendor-ID and product code must be the "
      "file's, the serial number need not.");
}

}  // namespace berth::cli
