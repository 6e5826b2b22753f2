/// Nodelist projects (.cpj; CiA 306-3 §6.2.2): the nodes of a network and the places of their DCFs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/result.hpp"
#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"

namespace berth::eds {

/// NodeNPresent, NodeNName...
struct ProjectNode {
  std::uint8_t node_id = 0;  ///< 1..127
  bool present = true;
  std::string name = {};
  std::string refd = {};
  std::string dcf_name = {};  ///< as written
  std::uint32_t line = 0;     ///< of its first key; 0 = not from a file
};

/// [Topology], [Topology2]...
struct Topology {
  std::uint16_t number = 1;  ///< [Topology] is 1
  std::string net_name = {};
  std::string net_refd = {};
  std::string eds_base_name = {};       ///< folder of the files, as written
  std::vector<ProjectNode> nodes = {};  ///< ascending by node-ID
};

struct Project {
  std::vector<Topology> topologies = {};  ///< ascending by number
};

struct ProjectReading {
  Document document;
  Project project;
  Findings findings;
  [[nodiscard]] bool usable() const noexcept { return !has_errors(findings); }
};

/// As tolerant as `read`: a wrong count, unknown keys and node numbers beyond 127 are findings. No topology is an
/// error.
[[nodiscard]] ProjectReading read_cpj(std::string text, std::string_view file_name, const ReadOptions& options = {});
[[nodiscard]] ProjectReading read_cpj_file(const std::filesystem::path& path, const ReadOptions& options = {});

/// Path of a node's DCF: `EDSBaseName` and `NodeNDCFName` beside the project. Errors: `Errc::not_found` when the node
/// names none, `Errc::invalid` for a path that leads out of the project's folder (absolute, drive letter, `..`); `\`
/// counts as `/`.
[[nodiscard]] Result<std::filesystem::path> dcf_path(const std::filesystem::path& project, const Topology& topology,
                                                     const ProjectNode& node);

/// A whole project file; reading it back gives an equal project.
[[nodiscard]] Written write_cpj(const Project& project, std::string_view line_end = "\r\n");

}  // namespace berth::eds
