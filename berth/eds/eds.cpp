#include "berth/eds/eds.hpp"

#include <algorithm>
#include <cstdio>

#include "berth/base/read_files.hpp"
#include "berth/eds/info.hpp"
#include "berth/eds/objects.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

Reading refused_description(std::string_view file_name, std::string message) {
  Reading reading;
  reading.file.description = od::DescriptionBuilder().build();
  reading.findings.push_back({Severity::error, std::string(file_name), 0, 0, "", std::move(message), ""});
  return reading;
}

}  // namespace

std::uint32_t File::identity(std::uint8_t sub, const std::optional<std::uint32_t>& otherwise) const {
  const od::SubObject* const found = description == nullptr ? nullptr : description->find(ObjectRef{0x1018, sub});
  if (found != nullptr && found->has_default && !found->relative && found->type == od::DataType::unsigned32) {
    const auto value = static_cast<std::uint32_t>(description->default_of(*found).raw);
    if (value != 0) return value;
  }
  return otherwise.value_or(0);
}

TypeCode File::type_code() const { return {identity(1, device.vendor_number), identity(2, device.product_number)}; }

std::uint32_t File::revision() const { return identity(3, device.revision_number); }

Reading read(std::string text, std::string_view file_name, const ReadOptions& options) {
  if (text.size() > options.max_bytes)
    return refused_description(file_name, "the file is too long for a device description");
  Reading reading;
  Report report(std::string(file_name), options.max_findings);
  reading.file.document = Document::parse(std::move(text), report);
  Context context(reading.file.document, report);
  reading.file.info = read_file_info(context);
  reading.file.device = read_device_info(context);
  reading.file.commissioning = read_commissioning(context);
  if (const Section* const comments = reading.file.document.find("Comments")) {
    reading.file.comments = read_comments(context, *comments);
  }
  reading.file.tools = read_tools(context);
  reading.file.dynamic_segments = read_dynamic_segments(context);
  reading.file.connected_modules = read_connected_modules(context);
  const std::uint32_t dummies = read_dummies(context);
  ObjectReader(context, reading.file.device, options).run(reading.file, dummies);
  reading.findings = report.take();
  return reading;
}

Reading read_file(const std::filesystem::path& path, const ReadOptions& options) {
  auto text = read_text_file(path, options.max_bytes);
  if (!text) return refused_description(path.string(), std::move(text.error()));
  return read(std::move(*text), path.string(), options);
}

tl::expected<std::string, std::string> read_text_file(const std::filesystem::path& path, std::size_t max_bytes) {
  note_read(path.string());
  std::FILE* const file = std::fopen(path.string().c_str(), "rb");
  if (file == nullptr) return tl::unexpected<std::string>("the file cannot be opened");
  std::string text;
  std::size_t got = 1;
  while (got != 0 && text.size() <= max_bytes) {
    const std::size_t before = text.size();
    text.resize(before + (1U << 16U));
    got = std::fread(text.data() + before, 1, 1U << 16U, file);
    text.resize(before + got);
  }
  const bool failed = std::ferror(file) != 0;
  std::fclose(file);
  if (failed) return tl::unexpected<std::string>("the file cannot be read");
  return text;
}

}  // namespace berth::eds
