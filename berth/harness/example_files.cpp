#include "berth/harness/example_files.hpp"

#include <stdlib.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <utility>

#include "berth/harness/example_data.hpp"

namespace berth::harness {
namespace {

Error failed(int error) {
  return {.code = Errc::io, .detail = static_cast<std::uint32_t>(error), .text = "making the folder of example files"};
}

}  // namespace

ExampleFiles::ExampleFiles(std::string path) noexcept : path_(std::move(path)) {}
ExampleFiles::ExampleFiles(ExampleFiles&& other) noexcept : path_(std::exchange(other.path_, {})) {}

ExampleFiles::~ExampleFiles() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

Result<ExampleFiles> ExampleFiles::make() {
  std::error_code error;
  const auto above = std::filesystem::temp_directory_path(error);
  if (error) return fail(failed(error.value()));
  std::string path = (above / "berth-worlds-XXXXXX").string();
  if (::mkdtemp(path.data()) == nullptr) return fail(failed(errno));
  ExampleFiles files(std::move(path));
  for (const auto& example : example_data()) {
    std::ofstream out(files.path_ + "/" + std::string(example.name), std::ios::binary);
    out << example.text;
    out.close();
    if (!out) return fail(failed(errno != 0 ? errno : EIO));
  }
  return files;
}

}  // namespace berth::harness
