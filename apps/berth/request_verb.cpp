#include "request_verb.hpp"

#include <fmt/ranges.h>

#include <filesystem>
#include <iterator>
#include <sstream>

#include "adopt.hpp"
#include "berth/command/verbs.hpp"
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
  // A session needs a bit rate to begin with, so it cannot search for it.
  if (request.arguments.contains("bitrate")) return run_bit_rate(options);
  if (options.yes) request.arguments["yes"] = "1";
  // Another process may carry out the request in another folder.
  const auto file = request.arguments.find("file");
  if (file != request.arguments.end()) file->second = std::filesystem::absolute(file->second).string();
  return run_single(options, std::move(request));
}

// The spelling on the command line: "--save" for store, "--serial-low" for serial-low.
std::string spelled(const command::Parameter& parameter) {
  const std::string name(parameter.name);
  if (parameter.form == command::Form::word) return name;
  return parameter.spelled.empty() ? "--" + name : std::string(parameter.spelled);
}

void word_of(const Verb& verb, const std::shared_ptr<command::Request>& request, const command::Parameter& parameter) {
  const std::string key(parameter.name);
  const std::string help(parameter.help);
  if (parameter.form == command::Form::flag) {
    verb.flag(
        spelled(parameter), [request, key] { request->arguments[key] = "1"; }, help);
    return;
  }
  Word word = verb.word(
      spelled(parameter), [request, key](const std::string& text) { request->arguments[key] = text; }, help);
  if (parameter.required) word.required();
  if (!parameter.value.empty()) word.shown(std::string(parameter.value));
  if (!parameter.choices.empty()) {
    std::istringstream choices{std::string(parameter.choices)};
    word.offers({std::istream_iterator<std::string>(choices), {}});
  }
}

}  // namespace

std::string help_of(const std::string& request) { return std::string(command::verb(request)->help); }

std::string one_a_line(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, "\n")); }

RequestVerb::RequestVerb(const Verb& parent, Options& options, const std::string& name, const std::string& request,
                         Finish finish, RequestWords which)
    : request_(std::make_shared<command::Request>(command::Request{request, {}})),
      verb_(parent.add(name, help_of(request), [&options, made = request_, finish = std::move(finish)] {
        return run_request(options, *made, finish);
      })) {
  request_words(verb_, options, request_, which);
}

void bus_words(const Verb& verb, Options& options, RequestWords which) {
  machine_words(verb, options, which.machine);
  control_word(verb, options);
  if (which.alone && which.bit_rate) {
    verb.word("--bitrate", options.bit_rate, "bit/s, for --port without a machine file")
        .from_to(10'000, 1'000'000)
        .shown("BIT/S");
  }
  if (which.alone) {
    verb.word("--eds", options.eds, "descriptions of devices without a slot: FILE for all, NODE=FILE for one")
        .one_each()
        .shown("[NODE=]FILE");
  }
  if (which.up)
    verb.flag("--up", options.single.bring_up, "with --sim: first run the main job until the machine is operational");
}

void request_words(const Verb& verb, Options& options, const std::shared_ptr<command::Request>& request,
                   RequestWords which) {
  bus_words(verb, options, which);
  for (const command::Parameter& parameter : command::verb(request->verb)->parameters) {
    const bool reads = parameter.form != command::Form::common && parameter.form != command::Form::own;
    if (reads) word_of(verb, request, parameter);
  }
}

}  // namespace berth::cli
