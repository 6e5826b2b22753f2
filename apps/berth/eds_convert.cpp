// `berth eds convert`: converts a description into another form, and reports what that form cannot hold.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/dcf.hpp"
#include "berth/eds/write.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/file.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"
#include "eds.hpp"
#include "outputs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
using Severity = Finding::Severity;
namespace fs = std::filesystem;

enum class Format : std::uint8_t { eds, dcf, xdd, xdc, concise };

struct FormatName {
  const char* word;
  Format format;
};
constexpr std::array<FormatName, 6> formats{{{"eds", Format::eds},
                                             {"dcf", Format::dcf},
                                             {"xdd", Format::xdd},
                                             {"xdc", Format::xdc},
                                             {"cdcf", Format::concise},
                                             {"bin", Format::concise}}};

std::optional<Format> format_of(std::string word) {
  std::ranges::transform(word, word.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const FormatName& each : formats) {
    if (word == each.word) return each.format;
  }
  return std::nullopt;
}

std::optional<Format> format_by_extension(const std::string& path) {
  const std::string extension = fs::path(path).extension().string();
  return extension.empty() ? std::nullopt : format_of(extension.substr(1));
}

const char* name(Format format) {
  switch (format) {
    case Format::eds: return "EDS";
    case Format::dcf: return "DCF";
    case Format::xdd: return "XDD";
    case Format::xdc: return "XDC";
    case Format::concise: return "concise DCF";
  }
  return "";
}

struct Converted {
  std::string bytes;
  Findings findings;
};
using Conversion = tl::expected<Converted, Failure>;

tl::unexpected<Failure> wrong(int status, const std::string& message) {
  return tl::unexpected(failure(status, message));
}

std::string where(const Error& error) {
  const std::string object =
      error.index != 0 ? fmt::format("object {}: ", od::write_object({error.index, error.sub})) : std::string();
  return object + error.text;
}

class Converter {
 public:
  Converter(const EdsOptions& asked, Format to)
      : asked_(asked), to_(to), in_(asked.files.at(0)), out_(asked.files.at(1)) {}

  [[nodiscard]] Conversion run() {
    return format_by_extension(in_) == Format::concise ? from_concise() : from_description();
  }

 private:
  /// Reads a description; fails if it is not usable.
  tl::expected<Described, Failure> read(const std::string& name) const {
    Described file = describe_file(name);
    if (!file.readable() || !file.reading.usable()) return tl::unexpected(unusable(file));
    return file;
  }

  Conversion from_description() {
    auto file = read(in_);
    if (!file) return tl::unexpected(file.error());
    eds::File& read = file->reading.file;
    const bool configuration = to_ == Format::dcf || to_ == Format::xdc;
    if (asked_.node && !read.commissioning) read.commissioning.emplace();
    if (asked_.node) read.commissioning->node_id = NodeId(static_cast<std::uint8_t>(*asked_.node));
    if (configuration && read.info.last_eds.empty()) read.info.last_eds = fs::path(in_).filename().string();
    auto made = write(read, *file);
    if (made) tell_dropped(*file, made->findings);
    return made;
  }

  /// Reports content that the reader does not keep, and that no written form therefore has.
  static void tell_dropped(const Described& source, Findings& findings) {
    const auto drops = [](const Finding& each) { return each.message.ends_with("own: left out"); };
    std::ranges::copy_if(source.reading.findings, std::back_inserter(findings), drops);
  }

  Conversion write(eds::File& file, const Described& source) {
    file.info.file_name = fs::path(out_).filename().string();
    switch (to_) {
      case Format::concise: return to_concise(file, source.name);
      case Format::xdd:
      case Format::xdc: {
        auto written = eds::write_xdd(file, {.values = to_ == Format::xdc, .file_name = file.info.file_name});
        return Converted{std::move(written.text), std::move(written.findings)};
      }
      default: {
        auto written = eds::write(file, {.form = to_ == Format::dcf ? eds::Form::dcf : eds::Form::eds});
        Converted made{std::move(written.text), std::move(written.findings)};
        for (Finding& each : made.findings) {
          if (each.line != 0) each.file = source.name;
        }
        for (const Finding& each : source.reading.findings) {
          // Content of an XDD that an EDS cannot hold.
          if (each.message.starts_with("read over")) made.findings.push_back(each);
        }
        return made;
      }
    }
  }

  /// The given node-ID, else the file's; unconfigured suffices until a value needs it.
  NodeId node_of(const eds::File& file) const {
    if (asked_.node) return NodeId(static_cast<std::uint8_t>(*asked_.node));
    return file.commissioning ? file.commissioning->node_id.value_or(NodeId()) : NodeId();
  }

  Conversion to_concise(const eds::File& file, const std::string& name) const {
    if (file.parameters.empty()) {
      return wrong(
          Exit::no,
          fmt::format("{} sets no value: a concise DCF of it would be empty; give a DCF or XDC with ParameterValues",
                      name));
    }
    const NodeId node = node_of(file);
    const auto concise = eds::concise_dcf(file, node);
    if (!concise) {
      const char* const fix = node.configured() ? "" : "; no node-ID is known: give --node N";
      return wrong(Exit::usage, fmt::format("{}: {}{}", name, where(concise.error()), fix));
    }
    const auto bytes = eds::encode(*concise);
    Converted made{std::string(bytes.begin(), bytes.end()), {}};
    if (!file.file_references.empty()) {
      made.findings.push_back({Severity::warning,
                               {},
                               0,
                               0,
                               "DownloadFile",
                               "the content of files beside the DCF is not in the concise DCF",
                               ""});
    }
    std::size_t kept_back = 0;
    for (const auto& parameter : file.parameters) {
      const bool there =
          std::ranges::any_of(concise->entries, [&](const auto& each) { return each.object == parameter.object; });
      if (!there) ++kept_back;
    }
    if (kept_back != 0) {
      made.findings.push_back(
          {Severity::note,
           {},
           0,
           0,
           "",
           fmt::format(
               "{} values of objects that cannot be written, or that ObjFlags keep from downloads, are left out",
               kept_back),
           ""});
    }
    return made;
  }

  Conversion from_concise() {
    if (to_ == Format::concise) return wrong(Exit::usage, fmt::format("{} is a concise DCF already", in_));
    if (asked_.eds.empty()) {
      return wrong(
          Exit::usage,
          fmt::format("{} is a concise DCF and has no names or types; give the device's description: --eds FILE", in_));
    }
    if (to_ != Format::dcf && to_ != Format::xdc) {
      return wrong(Exit::usage,
                   fmt::format("a concise DCF is a configuration: write a DCF or an XDC, not an {}", name(to_)));
    }
    Findings findings;
    const auto bytes = text::read_file(in_, findings);
    if (!bytes) return tl::unexpected(failure(findings));
    const auto concise =
        eds::decode_concise_dcf(std::span(reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()));
    if (!concise)
      return wrong(Exit::usage, fmt::format("{}: at byte {}: {}", in_, concise.error().detail, where(concise.error())));
    auto file = read(asked_.eds);
    if (!file) return tl::unexpected(file.error());
    eds::File& device = file->reading.file;
    const NodeId node = node_of(device);
    auto values = eds::parameters(*concise, *device.description, node);
    if (!values)
      return wrong(Exit::usage, fmt::format("{} does not fit {}: {}", in_, asked_.eds, where(values.error())));
    if (!device.commissioning) device.commissioning.emplace();
    if (node.configured()) device.commissioning->node_id = node;
    device.info.last_eds = fs::path(asked_.eds).filename().string();
    // Keeps the comments and the order of the EDS.
    if (to_ == Format::dcf && !device.document.sections().empty()) {
      const auto text = eds::make_dcf(device, {.commissioning = device.commissioning,
                                               .parameters = *values,
                                               .denotations = {},
                                               .file_references = {},
                                               .file_name = fs::path(out_).filename().string(),
                                               .last_eds = device.info.last_eds,
                                               .modification_time = {},
                                               .modification_date = {},
                                               .modified_by = {}});
      if (!text) return wrong(Exit::usage, fmt::format("{}: {}", asked_.eds, where(text.error())));
      return Converted{*text, {}};
    }
    set_values(device, std::move(*values));
    return write(device, *file);
  }

  static void set_values(eds::File& file, std::vector<eds::Parameter> values) {
    std::vector<eds::Parameter> defaults;
    for (const auto& each : values) {
      const auto old = std::ranges::find(file.defaults, each.object, &eds::Parameter::object);
      const bool was_set =
          std::ranges::find(file.parameters, each.object, &eds::Parameter::object) != file.parameters.end();
      const od::Literal initial = old != file.defaults.end() ? old->value
                                  : was_set                  ? od::Literal{}
                                            : file.description->default_of(*file.description->find(each.object));
      if (initial.present()) defaults.push_back({each.object, each.type, initial, 0});
    }
    file.parameters = std::move(values);
    file.defaults = std::move(defaults);
  }

  const EdsOptions& asked_;
  Format to_;
  std::string in_;
  std::string out_;
};

bool same_file(const std::string& a, const std::string& b) {
  std::error_code code;
  return fs::equivalent(a, b, code);
}

}  // namespace

int run_eds_convert(const Options& options, const EdsOptions& asked) {
  const std::string& in = asked.files.at(0);
  const std::string& out = asked.files.at(1);
  const auto to = asked.to.empty() ? format_by_extension(out) : format_of(asked.to);
  if (!to) {
    const std::string what = asked.to.empty() ? fmt::format("{}: the name does not say the format; end it in", out)
                                              : fmt::format("{} is not a format; write --to", text::quoted(asked.to));
    return tell(
        failure(Exit::usage, what + " eds, dcf, xdd, xdc, cdcf or bin" + (asked.to.empty() ? ", or give --to" : "")),
        options.json);
  }
  if (same_file(in, out))
    return tell(failure(Exit::usage, fmt::format("{} is the file to be read; name another for the result", out)),
                options.json);
  if (out != "-") {
    if (const auto bad = may_write(out, "the result", options.files.force)) return tell(*bad, options.json);
  }
  auto converted = Converter(asked, *to).run();
  if (!converted) return tell(converted.error(), options.json);
  const bool to_stream = out == "-";
  if (to_stream && options.json)
    return tell(failure(Exit::usage, "--json and the file itself cannot both go to standard output"), true);
  if (to_stream) {
    const std::string bytes = on_terminal() ? text::printable(converted->bytes) : converted->bytes;
    write_text(bytes);
  } else if (const auto bad = write_output(out, converted->bytes)) {
    return tell(*bad, options.json);
  }
  Json json;
  json["in"] = in;
  json["out"] = out;
  json["format"] = name(*to);
  json["bytes"] = converted->bytes.size();
  json["findings"] = Json::array();
  for (Finding& finding : converted->findings) {
    if (finding.file.empty()) finding.file = out;
    json["findings"].push_back({{"key", finding.key}, {"message", finding.message}});
    if (finding.line != 0) json["findings"].back()["line"] = finding.line;
    if (options.json) continue;
    if (to_stream) {
      print_error(to_string(finding));
    } else {
      print_line(to_string(finding));
    }
  }
  if (options.json) print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
  if (!options.json && !to_stream)
    print_line(fmt::format("{}: {}, {} bytes, from {}", out, name(*to), converted->bytes.size(), in));
  return Exit::done;
}

}  // namespace berth::cli
