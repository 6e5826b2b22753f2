/// The fuzz targets of a build without libFuzzer, in one program: fuzz/CMakeLists.txt writes the table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

struct Target {
  const char* name;
  int (*input)(const std::uint8_t* data, std::size_t size);
};

const std::vector<Target>& targets();
/// Holds a folder of files for each target.
extern const char* const corpus_folder;
