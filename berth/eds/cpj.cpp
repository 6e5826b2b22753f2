#include "berth/eds/cpj.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "berth/base/real_path.hpp"
#include "berth/eds/context.hpp"
#include "berth/eds/text.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

constexpr unsigned most_nodes = 127;
constexpr std::size_t most_topologies = 1024;

/// "Node12DCFName": 12 and "DCFName".
struct NodeKey {
  std::uint32_t number = 0;
  std::string_view word;
};
std::optional<NodeKey> node_key(std::string_view key) noexcept {
  if (!same_word(key.substr(0, 4), "Node")) return std::nullopt;
  const std::size_t end = key.find_first_not_of("0123456789", 4);
  if (end == std::string_view::npos || end == 4) return std::nullopt;
  const auto number = number_key(key.substr(4, end - 4));
  if (!number) return std::nullopt;
  return NodeKey{*number, key.substr(end)};
}

/// [Topology] is 1, [Topology2] is 2.
std::optional<std::uint16_t> topology_number(std::string_view name) noexcept {
  constexpr std::string_view word = "Topology";
  if (!same_word(name.substr(0, word.size()), word)) return std::nullopt;
  if (name.size() == word.size()) return std::uint16_t{1};
  const auto number = number_key(name.substr(word.size()));
  if (!number || *number == 0 || *number > 0xFFFF) return std::nullopt;
  return static_cast<std::uint16_t>(*number);
}

class TopologyReader {
 public:
  TopologyReader(Context& context, const Section& section) : context_(context), section_(section) {}

  Topology run(std::uint16_t number) {
    made_.number = number;
    for (const Entry& each : context_.document().entries(section_)) entry(each);
    std::size_t present = 0;
    for (auto& [id, node] : nodes_) {
      present += node.present ? 1 : 0;
      made_.nodes.push_back(std::move(node));
    }
    if (count_ == nullptr) {
      context_.warn(section_, nullptr, fmt::format("Nodes is missing; {} are there", nodes_.size()));
    } else if (promised_ && *promised_ != nodes_.size() && *promised_ != present) {
      context_.warn(section_, count_, fmt::format("says {}, {} nodes are there", *promised_, nodes_.size()));
    }
    return std::move(made_);
  }

 private:
  void entry(const Entry& each) {
    const std::string_view key = context_.document().key(each);
    if (same_word(key, "NetName")) {
      made_.net_name = context_.text(&each);
    } else if (same_word(key, "NetRefd")) {
      made_.net_refd = context_.text(&each);
    } else if (same_word(key, "EDSBaseName")) {
      made_.eds_base_name = context_.text(&each);
    } else if (same_word(key, "Nodes")) {
      count_ = &each;
      promised_ = context_.number(section_, &each, 0xFFFF'FFFF, Severity::warning);
    } else if (const auto found = node_key(key)) {
      node(each, *found);
    } else {
      context_.tell(Severity::note, section_, &each, "CiA 306-3 does not know this key; it is left out");
    }
  }

  void node(const Entry& each, const NodeKey& key) {
    if (key.number == 0 || key.number > most_nodes) {
      context_.warn(section_, &each, fmt::format("{} is not a node-ID; left out", key.number), "use 1 to 127");
      return;
    }
    const auto id = static_cast<std::uint8_t>(key.number);
    const auto known = [&key](std::string_view word) { return same_word(key.word, word); };
    if (!known("Present") && !known("Name") && !known("Refd") && !known("DCFName")) {
      context_.tell(Severity::note, section_, &each, "CiA 306-3 does not know this key; it is left out");
      return;
    }
    const auto [place, fresh] = nodes_.try_emplace(id);
    ProjectNode& made = place->second;
    if (fresh) {
      made.node_id = id;
      made.present = false;
      made.line = each.line;
    }
    if (known("Present")) made.present = context_.flag(section_, &each);
    if (known("Name")) made.name = context_.text(&each);
    if (known("Refd")) made.refd = context_.text(&each);
    if (known("DCFName")) made.dcf_name = context_.text(&each);
  }

  Context& context_;
  const Section& section_;
  Topology made_;
  std::map<std::uint8_t, ProjectNode> nodes_;
  const Entry* count_ = nullptr;
  std::optional<std::uint64_t> promised_;
};

ProjectReading refused_project(std::string_view file_name, std::string message) {
  ProjectReading reading;
  reading.findings.push_back({Severity::error, std::string(file_name), 0, 0, "", std::move(message), ""});
  return reading;
}

/// A path inside the project's folder; empty if it may lead out of it.
std::optional<std::filesystem::path> inner_path(std::string text) {
  std::ranges::replace(text, '\\', '/');
  const bool odd = std::ranges::any_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == ':'; });
  const std::filesystem::path path(text);
  if (odd || path.is_absolute() || text.starts_with('/')) return std::nullopt;
  for (const auto& each : path) {
    if (each == "..") return std::nullopt;
  }
  return path;
}

bool is_link_out(const std::filesystem::path& path, const std::filesystem::path& folder) {
  const auto home = real_path(folder.empty() ? "." : folder);
  return home.empty() || !is_beneath(real_path(path), home);
}

}  // namespace

ProjectReading read_cpj(std::string text, std::string_view file_name, const ReadOptions& options) {
  if (text.size() > options.max_bytes) return refused_project(file_name, "the file is too long for a project");
  ProjectReading reading;
  Report report(std::string(file_name), options.max_findings);
  reading.document = Document::parse(std::move(text), report);
  Context context(reading.document, report);
  std::map<std::uint16_t, Topology> found;
  for (const Section& each : reading.document.sections()) {
    const auto number = topology_number(reading.document.name(each));
    if (!number) {
      context.tell(Severity::note, each, nullptr, "CiA 306-3 does not know this section; it is left out");
      continue;
    }
    if (found.contains(*number)) context.warn(each, nullptr, "the section appears twice; the last one is used");
    if (found.size() < most_topologies || found.contains(*number)) {
      found.insert_or_assign(*number, TopologyReader(context, each).run(*number));
    }
  }
  if (found.empty() && !report.has_error()) {
    report.add(Severity::error, 0, 0, "[Topology]", "the section is missing: this is not a nodelist project");
  }
  for (auto& [number, topology] : found) reading.project.topologies.push_back(std::move(topology));
  reading.findings = report.take();
  return reading;
}

ProjectReading read_cpj_file(const std::filesystem::path& path, const ReadOptions& options) {
  auto text = read_text_file(path, options.max_bytes);
  if (!text) return refused_project(path.string(), std::move(text.error()));
  return read_cpj(std::move(*text), path.string(), options);
}

Result<std::filesystem::path> dcf_path(const std::filesystem::path& project, const Topology& topology,
                                       const ProjectNode& node) {
  if (node.dcf_name.empty()) return fail(Errc::not_found, "the node names no DCF");
  const auto folder = inner_path(topology.eds_base_name);
  const auto name = inner_path(node.dcf_name);
  if (!folder || !name) return fail(Errc::invalid, "the DCF's path leads out of the project's folder");
  const auto path = (project.parent_path() / *folder / *name).lexically_normal();
  if (is_link_out(path, project.parent_path()))
    return fail(Errc::invalid, "the DCF's path is a link that leads out of the project's folder");
  return path;
}

Written write_cpj(const Project& project, std::string_view line_end) {
  TextBuilder out(line_end, Encoding::utf8);
  for (const Topology& each : project.topologies) {
    out.section(each.number <= 1 ? std::string("Topology") : fmt::format("Topology{}", each.number));
    out.text("NetName", each.net_name);
    out.text("NetRefd", each.net_refd);
    out.plain("Nodes", fmt::format("0x{:02X}", each.nodes.size()));
    for (const ProjectNode& node : each.nodes) {
      const auto key = [&node](const char* word) { return fmt::format("Node{}{}", node.node_id, word); };
      out.plain(key("Present"), node.present ? "0x01" : "0x00");
      out.text(key("Name"), node.name);
      out.text(key("Refd"), node.refd);
      out.text(key("DCFName"), node.dcf_name);
    }
    out.text("EDSBaseName", each.eds_base_name);
  }
  Written written;
  written.text = out.take_text();
  written.findings = out.take_findings();
  return written;
}

}  // namespace berth::eds
