// Any bytes as an EDS or DCF: answered within bounds, and a device made of what came out behaves like a dictionary.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "berth/eds/eds.hpp"
#include "berth/od/values.hpp"

namespace {

using namespace berth;

void require(bool holds) {
  if (!holds) std::abort();
}

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
  return 0;
}
