#include "berth/manager/configuration_upload.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "berth/eds/write.hpp"
#include "berth/manager/object_ranges_parts.hpp"
#include "berth/manager/stored_dcf.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::manager {
namespace {

constexpr std::size_t longest_number = 8;
constexpr std::size_t longest_text = 65'536;

// `$NODEID` and a number if the description has this form; else the number, or the bytes.
od::Literal literal_of(const od::Description& description, const od::SubObject& sub, NodeId node,
                       std::span<const std::uint8_t> bytes) {
  if (sub.variable_length()) return od::Literal::octets(bytes);
  const std::uint64_t raw = od::load(sub.type, bytes.data());
  if (!sub.relative) return od::Literal::number(raw);
  od::Literal relative = description.default_of(sub);
  return relative.resolve(sub.type, node.value()) == raw ? relative : od::Literal::number(raw);
}

// Leaves out outputs: the process determines their values.
void leave_out_outputs(std::vector<eds::Parameter>& parameters) {
  std::set<ObjectRef> outputs;
  for (const auto& each : parameters) {
    if (!od::is_pdo_mapping(each.object.index) || each.object.sub == 0) continue;
    if (od::PdoRecord::of(each.object.index).kind != od::PdoKind::rpdo) continue;
    outputs.insert(od::PdoEntry::of(static_cast<std::uint32_t>(each.value.raw)).object);
  }
  std::erase_if(parameters, [&](const eds::Parameter& p) { return outputs.contains(p.object); });
}

}  // namespace

bool is_setting(const od::Object& object, const od::SubObject& sub) noexcept {
  constexpr std::uint8_t structure = 0xFF;
  const bool reads = od::readable(sub.access) && ((object.obj_flags | sub.obj_flags) & od::refuse_read_on_scan) == 0;
  const bool writes = od::writable(sub.access) && sub.access != od::Access::rww;
  return reads && writes && sub.type != od::DataType::domain && sub.sub != structure && !is_left_alone(object.index);
}

Result<std::string> make_dcf_text(const eds::File& eds, eds::Configuration configuration,
                                  std::vector<ObjectRef>& left_out) {
  if (eds.document.sections().empty()) {  // an XDD
    eds::File file = eds;
    file.parameters = std::move(configuration.parameters);
    file.commissioning = std::move(configuration.commissioning);
    return eds::write(file, {.form = eds::Form::dcf}).text;
  }
  for (;;) {
    auto text = eds::make_dcf(eds, configuration);
    if (text) return text;
    const ObjectRef bad{text.error().index, text.error().sub};
    const auto gone = std::erase_if(configuration.parameters, [&](const eds::Parameter& p) { return p.object == bad; });
    if (gone == 0) return text;
    left_out.push_back(bad);
  }
}

rt::Task<Result<std::string>> read_own_eds(co::SdoAccess& device) {
  constexpr std::uint16_t stored_eds = 0x1021;
  constexpr std::uint16_t format_of_eds = 0x1022;
  const auto text = co_await device.read_up_to(stored_eds, 0, longest_stored_text);
  const bool lacks = !text && text.error().code == Errc::aborted;
  if (lacks) co_return fail(Errc::not_found, "the device has no EDS of its own (1021h)");
  if (!text) co_return fail(text.error());
  const auto format = co_await device.read_up_to(format_of_eds, 0, 4);
  const bool plain = !format || format->bytes().empty() || format->bytes().front() == stored_format::ascii;
  if (!plain) co_return fail(Errc::unsupported, "the format of its 1021h is not known");
  co_return std::string(text->bytes().begin(), text->bytes().end());
}

rt::Task<Result<UploadedConfiguration>> upload_configuration(co::SdoAccess& device, const eds::File& eds, NodeId node) {
  UploadedConfiguration uploaded;
  eds::Configuration configuration;
  configuration.commissioning = eds.commissioning.value_or(eds::Commissioning{});
  configuration.commissioning->node_id = node;
  const od::Description& description = *eds.description;
  for (const od::Object& object : description.objects()) {
    for (const od::SubObject& sub : description.subs(object)) {
      if (!is_setting(object, sub)) continue;
      const std::size_t size = od::byte_size(sub.type);
      const std::size_t longest = size == 0 ? longest_text : longest_number;
      const auto value = co_await device.read_up_to(object.index, sub.sub, longest);
      const bool answers = value || value.error().code == Errc::aborted || value.error().code == Errc::mismatch;
      if (!answers) co_return fail(value.error());
      // A DCF cannot distinguish an empty text from none.
      const bool fits = value && (size == 0 ? !value->bytes().empty() : value->bytes().size() == size);
      if (!value) ++uploaded.refused;
      if (!fits) continue;
      configuration.parameters.push_back(
          {{object.index, sub.sub}, sub.type, literal_of(description, sub, node, value->bytes()), 0});
    }
  }
  leave_out_outputs(configuration.parameters);
  if (configuration.parameters.empty()) co_return fail(Errc::not_found, "nothing of its configuration can be read");
  uploaded.read = configuration.parameters.size();
  auto text = make_dcf_text(eds, std::move(configuration), uploaded.left_out);
  if (!text) co_return fail(text.error());
  uploaded.dcf = std::move(*text);
  co_return uploaded;
}

}  // namespace berth::manager
