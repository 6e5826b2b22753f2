// The words and options of `berth eds`.
#include <memory>

#include "eds.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using EdsWords = std::shared_ptr<EdsOptions>;

Verb eds_verb(const Verb& eds, const char* name, const char* help, const char* examples, Options& options,
              const EdsWords& wanted, int (*run)(const Options&, const EdsOptions&)) {
  Verb verb = eds.add(name, help, [&options, wanted, run] { return run(options, *wanted); });
  verb.footer(std::string("Examples:\n") + examples);
  return verb;
}

void node_word(const Verb& verb, const EdsWords& wanted, const char* help) {
  verb.word("--node", wanted->node, help).from_to(1, 127).shown("N");
}

void add_check(const Verb& eds, Options& options, const EdsWords& wanted) {
  const Verb check = eds_verb(eds, "check", "what is wrong with a description, in words, and what to do about it",
                              "  berth eds check sensor.eds\n  berth eds check --strict --json *.eds *.dcf", options,
                              wanted, run_eds_check);
  check.word("file", wanted->files, "EDS, DCF, XDD or XDC").required().shown("FILE...");
  check.flag("--strict", wanted->strict, "exit status 1 for warnings too");
  check.flag("--quiet,-q", wanted->quiet, "no notes");
  json_flag(check, options);
}

void add_convert(const Verb& eds, Options& options, const EdsWords& wanted) {
  const Verb convert =
      eds_verb(eds, "convert", "convert a description to another format, and report what that format cannot hold",
               "  berth eds convert sensor.eds sensor.xdd\n  berth eds convert left.dcf left.cdcf --node 5\n"
               "  berth eds convert left.cdcf left.dcf --eds sensor.eds --node 5",
               options, wanted, run_eds_convert);
  convert.word("files", wanted->files, "the file to read, the file to write (- for standard output)")
      .required()
      .values(2, 2)
      .shown("IN OUT");
  convert.word("--to", wanted->to, "eds, dcf, xdd, xdc, cdcf or bin (default: by the end of OUT)");
  convert.word("--eds", wanted->eds, "of a concise DCF: the device's description").shown("FILE");
  node_word(convert, wanted, "node-ID, for $NODEID and the commissioning");
  json_flag(convert, options);
  force_word(convert, options);
}

void add_diff(const Verb& eds, Options& options, const EdsWords& wanted) {
  const Verb diff =
      eds_verb(eds, "diff", "differences between two descriptions, or between a description and the device",
               "  berth eds diff old.eds new.eds\n"
               "  berth eds diff sensor.eds --node 5 -m machine.toml --sim plant.toml --up",
               options, wanted, run_eds_diff);
  diff.word("file", wanted->files, "one or two files").required().values(1, 2).shown("FILE [FILE]");
  node_word(diff, wanted, "compare with this device instead of a second file");
  diff.flag("--values", wanted->values, "with --node: compare values too");
  machine_words(diff, options, {.confirms = false, .sends = false});
  control_word(diff, options);
  diff.flag("--up", options.single.bring_up, "with --sim: first run the main job until the machine is operational");
}

void add_show(const Verb& eds, Options& options, const EdsWords& wanted) {
  const Verb show =
      eds_verb(eds, "show", "the object dictionary as a table, or one object in detail",
               "  berth eds show sensor.eds\n  berth eds show sensor.eds 0x1018\n  berth eds show sensor.eds heartbeat",
               options, wanted, run_eds_show);
  show.word(
          "file", [wanted](const std::string& file) { wanted->files = {file}; }, "EDS, DCF, XDD or XDC")
      .required()
      .shown("FILE");
  show.word("object", wanted->object, "index (1018h, 0x1018:1) or a part of a name").shown("OBJECT");
  json_flag(show, options);
}

}  // namespace

void add_eds(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<EdsOptions>();
  const Verb eds = berth.group("eds", "device descriptions: EDS, DCF, XDD, XDC");
  eds.footer("Examples:\n  berth eds check drive.eds\n  berth help eds convert");
  add_check(eds, options, wanted);
  add_convert(eds, options, wanted);
  add_diff(eds, options, wanted);
  add_show(eds, options, wanted);
}

}  // namespace berth::cli
