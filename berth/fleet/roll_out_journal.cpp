#include "berth/fleet/roll_out_journal.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "berth/base/part_file.hpp"

namespace berth::fleet {
namespace {

using Json = nlohmann::ordered_json;
constexpr int format = 1;
constexpr std::size_t longest = std::size_t{16} << 20U;

Json json_of(const RollOutJournal::What& what) {
  return {{"berth_roll_out", format}, {"command", what.command}, {"slot", what.slot}, {"crc32", what.crc}};
}

std::string text_in(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  return found == json.end() || !found->is_string() ? std::string() : found->get<std::string>();
}

std::string because(const std::string& path) { return fmt::format("{}: {}", path, std::strerror(errno)); }

// Appends one line.
std::string append(const std::string& path, const std::string& line) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file < 0) return because(path);
  const std::string text = line + "\n";
  const auto written = ::write(file, text.data(), text.size());
  const bool good = written == static_cast<ssize_t>(text.size()) && ::fsync(file) == 0;
  std::string problem = good ? std::string() : because(path);
  ::close(file);
  return problem;
}

}  // namespace

tl::expected<RollOutJournal, std::string> RollOutJournal::begin(std::string path, const What& what) {
  auto problem = append(path, json_of(what).dump());
  if (!problem.empty()) return tl::unexpected(std::move(problem));
  sync_folder_of(path);
  return RollOutJournal(std::move(path), {});
}

tl::expected<RollOutJournal, std::string> RollOutJournal::open(std::string path, const What& what) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return begin(std::move(path), what);
  const auto size = std::filesystem::file_size(path, none);
  std::ifstream file(path, std::ios::binary);
  if (none || !file || size > longest) return tl::unexpected(path + ": it cannot be read, or is no journal");
  const std::string content{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  // A crash cut the first line off.
  if (json_of(what).dump().starts_with(content)) {
    std::filesystem::resize_file(path, 0, none);
    return begin(std::move(path), what);
  }
  std::istringstream lines(content);
  std::string line;
  std::getline(lines, line);
  const auto head = Json::parse(line, nullptr, false);
  if (!head.is_object() || !head.contains("berth_roll_out"))
    return tl::unexpected(path + ": it is no journal of a roll-out; name another by --journal");
  if (head != json_of(what)) {
    return tl::unexpected(path +
                          ": it is the journal of another roll-out (another file, slot or version); name another by "
                          "--journal, or delete it");
  }
  std::vector<sparkplug::EdgeNodeId> done;
  while (std::getline(lines, line)) {
    const auto json = Json::parse(line, nullptr, false);
    if (text_in(json, "result") != "done") continue;
    done.push_back({text_in(json, "group"), text_in(json, "machine")});
  }
  const bool cut_off = !content.empty() && content.back() != '\n';
  if (cut_off) {
    auto problem = append(path, "");  // ends the line
    if (!problem.empty()) return tl::unexpected(std::move(problem));
  }
  return RollOutJournal(std::move(path), std::move(done));
}

std::string RollOutJournal::add(const sparkplug::EdgeNodeId& machine, bool done, const std::string& words) {
  if (done) done_.push_back(machine);
  const Json json{
      {"group", machine.group}, {"machine", machine.node}, {"result", done ? "done" : "failed"}, {"words", words}};
  return append(path_, json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace berth::fleet
