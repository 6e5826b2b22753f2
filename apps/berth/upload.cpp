// `berth upload`: reads the configuration of a slot's device into the slot's file, so that a replacement gets it.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/text/quantity.hpp"
#include "machine_file.hpp"
#include "request_verb.hpp"
#include "sdo.hpp"
#include "single.hpp"
#include "verbs.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

struct UploadOptions {
  std::shared_ptr<command::Request> request =
      std::make_shared<command::Request>(command::Request{"upload", {{"dcf", "1"}}});
  std::string output;
  bool dry_run = false;
};

// The file to write: --output, else that of `config =`.
tl::expected<std::string, Failure> target_of(const Options& options, const UploadOptions& wanted, const Json& reply) {
  if (!wanted.output.empty()) return wanted.output;
  const auto machine = machine_of(options);
  if (!machine) return tl::unexpected(machine.error());
  const std::string name = reply.at("slot").get<std::string>();
  for (const auto& slot : machine->slots) {
    if (slot.spec.name.name != name || slot.spec.name.bus != reply.at("bus").get<std::string>()) continue;
    const std::filesystem::path path(slot.spec.config);
    if (path.extension() == ".dcf") return slot.spec.config;
    if (!path.empty()) {
      return tl::unexpected(failure(
          Exit::usage, fmt::format("config = \"{}\" is not a DCF; say where to: --output FILE.dcf", slot.spec.config)));
    }
  }
  return tl::unexpected(failure(
      Exit::usage,
      fmt::format("slot {} has no config =; say where to: --output FILE.dcf, and give the slot config = \"FILE.dcf\"",
                  text::quoted(name))));
}

int run_upload(const Options& given, const UploadOptions& wanted) {
  Options options = given;
  options.machine = default_machine(given);
  const auto reply = carry_out(options, *wanted.request);
  if (!reply) return tell(reply.error(), options.json);
  if (reply->status != Exit::done) return tell({reply->status, reply->error, reply->json}, options.json);
  Json json = Json::parse(reply->json);
  const auto target = target_of(options, wanted, json);
  if (!target) return tell(target.error(), options.json);
  const auto bytes = bytes_of(json.at("dcf").get<std::string>());
  const std::string text(bytes.begin(), bytes.end());
  json.erase("dcf");
  json["file"] = *target;
  json["written"] = !wanted.dry_run;
  if (!wanted.dry_run) {
    if (const auto bad = write_whole({{*target, text}}, given.files.force)) return tell(*bad, options.json);
  }
  if (options.json) {
    print_text(json.dump(2));
    return Exit::done;
  }
  print_lines(reply->lines);
  print_line(fmt::format("{} {}: {} bytes", wanted.dry_run ? "would write" : "wrote", *target, text.size()));
  return Exit::done;
}

}  // namespace

void add_upload(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<UploadOptions>();
  const Verb upload =
      berth.add("upload", help_of("upload"), [&options, wanted] { return run_upload(options, *wanted); });
  request_words(upload, options, wanted->request, {.alone = false, .machine = {.confirms = false, .sends = false}});
  upload.word("--output,-o", wanted->output, "into this file (default: that of config =)").shown("FILE");
  upload.flag("--dry-run", wanted->dry_run, "read the device, say what differs, and write nothing");
  upload.footer(
      "Examples:\n  berth upload drive --dry-run\n  berth upload drive --force\n  berth upload drive -o drive.dcf\n"
      "What the device has is what a replacement gets: docs/machine-file.md.");
}

}  // namespace berth::cli
