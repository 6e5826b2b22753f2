// Any bytes as an EDS or DCF: answered within bounds, a device made of what came out behaves like a dictionary, an edit
// leaves all other bytes, and what is written anew is read as the same.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"
#include "berth/od/values.hpp"
#include "fuzz/require.hpp"
#include "tests/eds/random_description.hpp"

namespace eds_target {

namespace {

using namespace berth;

using fuzz::require;

void use(const od::Description& description, od::Values& device, std::vector<std::uint8_t>& buffer) {
  for (const od::Object& object : description.objects()) {
    require(description.find(object.index) == &object);
    for (const od::SubObject& sub : description.subs(object)) {
      const ObjectRef ref{object.index, sub.sub};
      require(description.find(ref) == &sub);
      (void)description.name(sub);
      (void)description.default_of(sub);
      const auto length = device.read(ref, buffer);
      if (!length) {
        require(!od::readable(sub.access) || sub.type == od::DataType::domain ||
                length.error() == od::AbortCode::out_of_memory);
        continue;
      }
      require(*length <= sub.capacity);
      const auto code = device.write(ref, std::span(buffer).first(*length));
      require(code != od::AbortCode::no_object && code != od::AbortCode::no_sub_index);
      require((code == od::AbortCode::read_only) == !od::writable(sub.access));
      (void)od::print(sub.type, std::span(buffer).first(*length));
    }
  }
}

bool same(const std::vector<eds::Parameter>& a, const std::vector<eds::Parameter>& b) {
  return std::ranges::equal(a, b, [](const eds::Parameter& x, const eds::Parameter& y) {
    return x.object == y.object && x.type == y.type && x.value == y.value;
  });
}

void write_and_read(const eds::File& file) {
  const auto written = eds::write(file, {.form = eds::Form::dcf});
  const auto lost = [](const Finding& each) { return each.severity != Finding::Severity::note; };
  if (std::ranges::any_of(written.findings, lost)) return;
  const auto back = eds::read(written.text, "back");
  require(back.usable());
  const eds::File& got = back.file;
  require(eds::test::difference(*file.description, *got.description).empty());
  require(got.device == file.device && got.commissioning == file.commissioning);
  require(got.comments == file.comments && got.tools == file.tools);
  require(got.dynamic_segments == file.dynamic_segments && got.object_links == file.object_links);
  require(got.modules == file.modules && got.connected_modules == file.connected_modules);
  require(got.denotations == file.denotations && got.param_refs == file.param_refs);
  require(same(got.parameters, file.parameters) && same(got.defaults, file.defaults));
  require(eds::write(got, {.form = eds::Form::dcf}).text == written.text);
}

void edit(const eds::Document& document) {
  require(eds::Editor(document).text() == document.text());
  const auto sections = document.sections();
  if (sections.empty()) return;
  const eds::Section& section = sections[document.text().size() % sections.size()];
  const auto name = document.name(section);
  if (section.count == 0 || document.find(name) != &section) return;
  const eds::Entry& entry = document.entries(section)[document.text().size() % section.count];
  const auto key = document.key(entry);
  if (document.find(section, key) != &entry) return;
  eds::Editor editor(document);
  if (!editor.set_raw(document.utf8(name), document.utf8(key), "x")) return;
  std::string expected = document.text();
  expected.replace(entry.value_at, entry.value_length, "x");
  const std::string got = editor.text();
  if (expected.compare(entry.value_at + 1, 1, ";") == 0) expected.insert(entry.value_at + 1, " ");
  require(got == expected);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(data, data + size);
  const auto reading =
      eds::read(text, "fuzz.eds",
                {.max_bytes = 1U << 20U, .max_sub_objects = 4096, .max_value_bytes = 1U << 18U, .max_findings = 200});
  require(reading.findings.size() <= 202);
  require(reading.file.description != nullptr);
  require(reading.file.document.text() == text);
  for (const auto& each : reading.findings) require(each.line >= 0 && static_cast<std::size_t>(each.line) <= size + 1);
  const od::Description& description = *reading.file.description;
  require(description.subs().size() <= 4096 + description.objects().size());
  od::Values device(reading.file.description, NodeId(1));
  std::vector<std::uint8_t> buffer(1024);
  use(description, device, buffer);
  device.reset(NodeId(127), od::Area::communication);
  device.reset(NodeId(), od::Area::application);
  use(description, device, buffer);
  for (const auto& each : reading.file.parameters) require(description.find(each.object) != nullptr);
  edit(reading.file.document);
  (void)eds::expand(reading.file);
  if (reading.usable()) write_and_read(reading.file);
  return 0;
}

}  // namespace eds_target
