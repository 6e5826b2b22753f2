// emcy, store, restore, send, history, status: each makes one request.
#include <memory>

#include "request_verb.hpp"
#include "verbs.hpp"

namespace berth::cli {

void add_emcy(Verb& berth, Options& options) {
  const auto time = std::make_shared<std::optional<std::chrono::nanoseconds>>();
  const RequestVerb emcy(berth, options, "emcy", "emcy",
                         [time](command::Request& request) -> std::string {
                           if (*time) {
                             const auto seconds = std::chrono::ceil<std::chrono::seconds>(**time).count();
                             request.arguments["listen"] = std::to_string(seconds);
                           } else if (!request.arguments.contains("node")) {
                             return "of which node? Or listen to all of them: berth emcy --listen \"30 s\"";
                           }
                           return {};
                         },
                         {.machine = {.confirms = false}});
  emcy.verb().time("--listen", *time, "instead: show the messages that come during this time");
  emcy.footer("Examples:\n  berth emcy drive\n  berth emcy 5 --port can0\n  berth emcy --listen \"30 s\" --port can0");
}

namespace {

void add_memory(Verb& berth, Options& options, const std::string& name, const std::string& example) {
  const RequestVerb memory(berth, options, name, name);
  memory.footer("Example:\n  " + example);
}

}  // namespace

void add_store(Verb& berth, Options& options) {
  add_memory(berth, options, "store", "berth store drive communication");
}

void add_restore(Verb& berth, Options& options) {
  add_memory(berth, options, "restore", "berth restore drive && berth nmt reset-node drive");
}

void add_send(Verb& berth, Options& options) {
  const auto frames = std::make_shared<std::vector<std::string>>();
  const RequestVerb send(berth, options, "send", "send", [frames](command::Request& request) {
    std::string& lines = request.arguments["frame"];
    for (const auto& frame : *frames) lines += (lines.empty() ? "" : "\n") + frame;
    return std::string();
  });
  send.verb().word("frame", *frames, "as candump writes it: 601#4018100400000000").required().shown("FRAME...");
  send.footer("Example:\n  berth send 080# 601#4018100400000000 --port can0");
}

namespace {
// For verbs whose frames need no consent of the user and are not known in advance.
constexpr RequestWords tells{.alone = false, .machine = {.confirms = false, .sends = false}};
}  // namespace

void add_history(Verb& berth, Options& options) {
  const RequestVerb history(berth, options, "history", "history", {}, tells);
  history.footer("Examples:\n  berth history\n  berth history left machine.toml\n  berth history --audit");
}

void add_status(Verb& berth, Options& options) {
  const RequestVerb status(berth, options, "status", "report", {}, tells);
  status.verb().time("--watch", options.single.watch, "repeat at this interval (default: 1 s)");
  colour_word(status.verb());
  status.footer(
      "Examples:\n  berth status\n  berth status left\n  berth status machine.toml --bus drives --watch \"2 s\"");
}

}  // namespace berth::cli
