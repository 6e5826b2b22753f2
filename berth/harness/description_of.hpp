// Description files of devices that report only a part of 1018h.
#pragma once

#include <unistd.h>
#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "berth/base/ids.hpp"

namespace berth::harness {

// Writes, into this folder, a description whose 1018h has only the first `parts` of its four parts; gives its path.
inline std::string description_of(const std::filesystem::path& folder, TypeCode type, unsigned parts) {
  std::array<char, 64> name{};
  // Another user's file of this name could not be replaced.
  std::snprintf(name.data(), name.size(), "berth-as-sold-%u-%08x-%08x-%u.eds", ::getuid(), type.vendor, type.product,
                parts);
  const auto file = folder / name.data();
  // Other processes may be writing it: the last rename wins, and all write the same.
  const auto half = folder / (name.data() + std::string(".") + std::to_string(::getpid()));
  std::ofstream out(half);
  out << "[DeviceInfo]\nVendorNumber=" << type.vendor << "\nProductNumber=" << type.product << "\nLSS_Supported=0\n"
      << "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n"
         "[OptionalObjects]\nSupportedObjects=1\n1=0x1017\n"
         "[1000]\nParameterName=Device type\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=0x20192\n"
         "[1001]\nParameterName=Error register\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue=0\n"
         "[1017]\nParameterName=Heartbeat\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=0\n"
         "[1018]\nParameterName=Identity\nObjectType=9\nSubNumber="
      << parts + 1 << "\n[1018sub0]\nParameterName=n\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue=" << parts
      << "\n";
  const std::array<std::uint32_t, 4> values{type.vendor, type.product, 0, 0};
  for (unsigned sub = 1; sub <= parts; ++sub) {
    out << "[1018sub" << sub
        << "]\nParameterName=p\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=" << values.at(sub - 1) << "\n";
  }
  out.close();
  std::filesystem::rename(half, file);
  return file.string();
}

}  // namespace berth::harness
