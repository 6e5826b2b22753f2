#include "whole_files.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "berth/base/part_file.hpp"
#include "options.hpp"

namespace berth::cli {
namespace {

Failure wrong(const std::string& path, int error) {
  return failure(error == EEXIST ? Exit::no : Exit::failed,
                 path + ": " + (error == EEXIST ? "is there already" : std::strerror(error)));
}

/// One of several files. If it is not kept, it is removed, and the earlier file is restored.
class Placing {
 public:
  explicit Placing(const std::string& path)
      : path_(path), before_(fmt::format("{}.{}.before", path, ::getpid())), part_(path) {}
  ~Placing() {
    if (placed_ && !kept_ && !saved_) ::unlink(path_.c_str());
    if (saved_ && !kept_) ::rename(before_.c_str(), path_.c_str());
    if (saved_ && kept_) ::unlink(before_.c_str());
  }
  Placing(const Placing&) = delete;
  Placing& operator=(const Placing&) = delete;

  /// 0, or an errno.
  [[nodiscard]] int write(std::string_view bytes) { return part_.write(bytes); }
  [[nodiscard]] int place(bool replace) {
    if (replace && ::link(path_.c_str(), before_.c_str()) == 0) saved_ = true;
    const int error = replace ? part_.replace() : part_.place_new();
    placed_ = error == 0;
    return error;
  }
  void keep() noexcept { kept_ = true; }

 private:
  std::string path_;
  std::string before_;
  PartFile part_;
  bool saved_ = false;
  bool placed_ = false;
  bool kept_ = false;
};

}  // namespace

std::optional<Failure> write_whole(const std::vector<WholeFile>& files, bool replace) {
  std::vector<std::unique_ptr<Placing>> placing;
  for (const auto& file : files) {
    std::error_code none;
    const auto there = std::filesystem::symlink_status(file.path, none);
    if (!replace && std::filesystem::exists(there)) return wrong(file.path, EEXIST);
    if (std::filesystem::is_directory(there)) return wrong(file.path, EISDIR);
    placing.push_back(std::make_unique<Placing>(file.path));
    if (const int error = placing.back()->write(file.bytes); error != 0) return wrong(file.path, error);
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (const int error = placing[i]->place(replace); error != 0) return wrong(files[i].path, error);
  }
  for (const auto& each : placing) each->keep();
  return std::nullopt;
}

std::optional<Failure> make_folder(const std::string& path) {
  if (::mkdir(path.c_str(), 0777) == 0 || errno == EEXIST) return std::nullopt;
  return failure(Exit::failed, path + ": " + std::strerror(errno));
}

}  // namespace berth::cli
