#include "request_verb.hpp"

#include "adopt.hpp"
#include "output.hpp"
#include "single.hpp"

namespace berth::cli {
namespace {

int run_request(const Options& options, command::Request request, const RequestVerb::Finish& finish) {
  if (finish) {
    if (const std::string wrong = finish(request); !wrong.empty()) {
      return tell(failure(Exit::usage, wrong), options.json);
    }
  }
  // No session can search for the bit rate: it would need one to begin with.
  if (request.arguments.contains("bitrate")) return run_bit_rate(options);
  if (options.yes) request.arguments["yes"] = "1";
  return run_single(options, std::move(request));
}

}  // namespace

RequestVerb::RequestVerb(const Verb& parent, Options& options, const std::string& name, const std::string& request,
                         const std::string& help, Finish finish, RequestWords which)
    : request_(std::make_shared<command::Request>(command::Request{request, {}})),
      verb_(parent.add(name, help, [&options, made = request_, finish = std::move(finish)] {
        return run_request(options, *made, finish);
      })) {
  request_words(verb_, options, which);
}

void request_words(const Verb& verb, Options& options, RequestWords which) {
  machine_words(verb, options, which.machine);
  control_word(verb, options);
  if (which.alone && which.bit_rate) {
    verb.word("--bitrate", options.bit_rate, "bit/s, where --port is all that is known of the bus")
        .from_to(10'000, 1'000'000)
        .shown("BIT/S");
  }
  if (which.alone) {
    verb.word("--eds", options.eds, "what devices are like that are in no slot: FILE, or of one NODE=FILE")
        .one_each()
        .shown("[NODE=]FILE");
  }
  if (which.up)
    verb.flag("--up", options.single.bring_up, "with --sim: first run the main job until the machine is operational");
}

Word RequestVerb::word(const std::string& names, const std::string& key, const std::string& help) const {
  return verb_.word(
      names, [made = request_, key](const std::string& text) { made->arguments[key] = text; }, help);
}

Word RequestVerb::flag(const std::string& names, const std::string& key, const std::string& help) const {
  return verb_.flag(
      names, [made = request_, key] { made->arguments[key] = "1"; }, help);
}

}  // namespace berth::cli
