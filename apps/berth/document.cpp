// `berth document`: writes a machine as HTML pages, and its buses as DBC files.
#include "berth/document/machine_document.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "machine_file.hpp"
#include "outputs.hpp"
#include "verbs.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;

std::optional<Failure> write_all(const std::vector<document::DocumentFile>& files, const fs::path& folder, bool force) {
  std::vector<std::string> paths;
  for (const auto& file : files) {
    paths.push_back((folder / file.name).string());
    if (auto bad = may_write(paths.back(), "--output", force)) return bad;
  }
  if (auto bad = make_folder(folder.string())) return bad;
  std::vector<WholeFile> whole;
  for (std::size_t i = 0; i < files.size(); ++i) whole.push_back({paths[i], files[i].bytes});
  return write_whole(whole, force);
}

int document(const Options& options, const std::string& folder) {
  const auto machine = machine_by_file(options);
  if (!machine) return tell(machine.error(), options.json);
  std::optional<traffic::LinkPlan> links;
  if (!machine->links.empty()) links = traffic::plan_links(*machine);
  if (links && has_errors(links->findings)) return tell(failure(links->findings), options.json);
  const auto files =
      document::document_of(*machine, links ? &*links : nullptr, fmt::format("Made by berth {}.", BERTH_VERSION));
  if (const auto bad = write_all(files, folder, options.files.force)) return tell(*bad, options.json);
  if (options.json) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const auto& file : files) names.push_back((fs::path(folder) / file.name).string());
    print_text(nlohmann::ordered_json{{"files", names}}.dump(2));
    return Exit::done;
  }
  print_line(fmt::format("{} in {}: begin with {}", counted(files.size(), "file"), folder,
                         (fs::path(folder) / "index.html").string()));
  return Exit::done;
}

}  // namespace

void add_document(Verb& berth, Options& options) {
  const auto folder = std::make_shared<std::string>();
  Verb verb = berth.add("document", "a machine as HTML pages that need no network, and its buses as DBC files",
                        [&options, folder] { return document(options, *folder); });
  json_flag(verb, options);
  force_word(verb, options);
  machine_word(verb, options);
  verb.word("--output,-o", *folder, "folder for the pages").shown("FOLDER").required();
  verb.footer(
      "Examples:\n  berth document machine.toml -o document\n  berth document machine.toml -o document --force");
}

}  // namespace berth::cli
