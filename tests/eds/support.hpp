/// Small device descriptions for the tests, and questions to what was read.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "berth/eds/eds.hpp"
#include "berth/od/values.hpp"
#include "tests/eds_folder.hpp"

namespace berth::eds::test {

using berth::test::eds_folder;
using Severity = Finding::Severity;

/// A valid file around the object sections of a test: lists name exactly `listed` (besides the mandatory ones).
inline std::string file_with(std::string_view sections, const std::vector<std::string>& listed = {"0x2000"}) {
  std::string text =
      "[FileInfo]\nFileName=t.eds\nEDSVersion=4.0\n[DeviceInfo]\nVendorName=v\nVendorNumber=1\nProductNumber=2\n"
      "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n"
      "[1000]\nParameterName=Device type\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=0\nPDOMapping=0\n"
      "[1001]\nParameterName=Error register\nObjectType=7\nDataType=5\nAccessType=ro\nPDOMapping=0\n"
      "[1018]\nParameterName=Identity\nObjectType=9\nSubNumber=2\n"
      "[1018sub0]\nParameterName=n\nDataType=5\nAccessType=const\nDefaultValue=1\n"
      "[1018sub1]\nParameterName=Vendor-ID\nDataType=7\nAccessType=ro\nDefaultValue=1\n";
  text += "[ManufacturerObjects]\nSupportedObjects=" + std::to_string(listed.size()) + "\n";
  for (std::size_t i = 0; i < listed.size(); ++i) text += std::to_string(i + 1) + "=" + listed[i] + "\n";
  text += sections;
  return text;
}

/// [2000], a VAR of a type with further lines.
inline std::string variable(int type, std::string_view lines, std::string_view access = "rw") {
  return "[2000]\nParameterName=Probe\nObjectType=7\nDataType=" + std::to_string(type) +
         "\nAccessType=" + std::string(access) + "\n" + std::string(lines) + "\n";
}

inline Reading read_text(std::string text) { return read(std::move(text), "t.eds"); }
inline Reading read_variable(int type, std::string_view lines, std::string_view access = "rw") {
  return read_text(file_with(variable(type, lines, access)));
}

/// Findings that are more than remarks, as text.
inline std::string complaints(const Reading& reading) {
  std::string text;
  for (const auto& each : reading.findings) {
    if (each.severity != Severity::note) text += to_string(each) + "\n";
  }
  return text;
}

inline const Finding* find(const Reading& reading, Severity severity, std::string_view key) {
  const auto found = std::ranges::find_if(
      reading.findings, [&](const Finding& each) { return each.severity == severity && each.key == key; });
  return found == reading.findings.end() ? nullptr : &*found;
}
inline bool warned(const Reading& reading, std::string_view key) {
  return find(reading, Severity::warning, key) != nullptr;
}
inline bool refused(const Reading& reading, std::string_view key) {
  return find(reading, Severity::error, key) != nullptr && !reading.usable();
}
/// A value that is none: told at its place, and the rest is used.
inline bool left_out(const Reading& reading, std::string_view key) {
  const auto* const told = find(reading, Severity::warning, key);
  return told != nullptr && told->message.find("left out") != std::string::npos && reading.usable();
}
inline bool noted(const Reading& reading, std::string_view key) {
  return find(reading, Severity::note, key) != nullptr;
}

/// A device of this description.
inline std::uint64_t value(const Reading& reading, std::uint16_t index, std::uint8_t sub = 0, std::uint8_t node = 5) {
  od::Values values(reading.file.description, NodeId(node));
  return values.get_or<std::uint64_t>({index, sub}, 0xBAD);
}
inline std::int64_t signed_value(const Reading& reading, std::uint16_t index, std::uint8_t sub = 0) {
  od::Values values(reading.file.description, NodeId(5));
  return values.get_or<std::int64_t>({index, sub}, 0xBAD);
}
inline const od::SubObject* sub(const Reading& reading, std::uint16_t index, std::uint8_t at = 0) {
  return reading.file.description->find(ObjectRef{index, at});
}
inline std::string name(const Reading& reading, std::uint16_t index, std::uint8_t at = 0) {
  const auto* const found = sub(reading, index, at);
  return found == nullptr ? "(none)" : std::string(reading.file.description->name(*found));
}

}  // namespace berth::eds::test
