// `berth init`: copies descriptions from other folders, since machine and plant files name only files of their own
// folder.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "berth/text/file.hpp"
#include "berth/text/reach.hpp"
#include "init.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;

tl::expected<std::string, Failure> content_of(const std::string& path) {
  Findings findings;
  auto content = text::read_file(path, findings);
  if (!content) return tl::unexpected(failure(findings));
  return *std::move(content);
}

Failure in_the_way(const InitCopy& copy, const std::string& what) {
  return failure(Exit::no,
                 fmt::format("{} is to be copied to {}, and {}; give one of them another name, or put both into the "
                             "machine's folder",
                             copy.from, copy.to, what));
}

// Reads the description, and checks whether the copy exists already. Only --force replaces a different file there.
tl::expected<void, Failure> look(InitCopy& copy, bool force) {
  auto bytes = content_of(copy.from);
  if (!bytes) return tl::unexpected(bytes.error());
  copy.bytes = *std::move(bytes);
  std::error_code none;
  if (!fs::exists(fs::symlink_status(copy.to, none))) return {};
  const auto there = content_of(copy.to);
  if (!there) return tl::unexpected(there.error());
  copy.there = *there == copy.bytes;
  if (!copy.there && !force) return tl::unexpected(in_the_way(copy, "another file is there already"));
  return {};
}

}  // namespace

tl::expected<std::vector<InitCopy>, Failure> take_along(InitPlan& plan, const InitOptions& init,
                                                        const std::vector<std::string>& allowed) {
  std::vector<InitCopy> copies;
  const fs::path folder = fs::path(init.file).parent_path();
  if (folder != fs::path(init.plant).parent_path()) return copies;
  const text::Reach reach(init.file, allowed);
  for (auto& bus : plan.buses) {
    for (auto& device : bus.devices) {
      if (device.eds.empty() || reach.path(fs::absolute(device.eds).string())) continue;
      InitCopy copy{device.eds, (folder / fs::path(device.eds).filename()).string(), {}, false};
      device.eds = copy.to;
      const auto same = std::ranges::find(copies, copy.to, &InitCopy::to);
      std::error_code none;
      const bool once_more = same != copies.end() && fs::equivalent(same->from, copy.from, none);
      if (once_more) continue;
      if (same != copies.end()) return tl::unexpected(in_the_way(copy, "so is " + same->from));
      if (const auto good = look(copy, init.force); !good) return tl::unexpected(good.error());
      plan.notes.push_back(fmt::format("{} comes along: copied to {}", copy.from, copy.to));
      copies.push_back(std::move(copy));
    }
  }
  return copies;
}

}  // namespace berth::cli
