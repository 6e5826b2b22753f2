/// Verbs that are one request. The table (berth/command/verbs.hpp) has their help and what may follow them: words,
/// options and flags become the request's arguments.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "berth/command/request.hpp"
#include "options.hpp"
#include "verb.hpp"

namespace berth::cli {

/// Which of the common words such a verb has.
struct RequestWords {
  bool up = true;        ///< --up: a running machine can be asked
  bool alone = true;     ///< --eds, --bitrate: a bus without a machine file can be asked
  bool bit_rate = true;  ///< --bitrate is a number
  MachineWords machine{};
};

/// A verb and the request that it makes.
class RequestVerb {
 public:
  /// Completes the request after everything is read. Returns what is wrong, empty if nothing.
  using Finish = std::function<std::string(command::Request&)>;

  /// `request`: the request's name in the table.
  RequestVerb(const Verb& parent, Options& options, const std::string& name, const std::string& request,
              Finish finish = {}, RequestWords which = {});
  void footer(const std::string& text) const { verb_.footer(text); }
  /// To add words of the form `own`, which `Finish` reads.
  [[nodiscard]] const Verb& verb() const noexcept { return verb_; }

 private:
  std::shared_ptr<command::Request> request_;
  Verb verb_;
};

/// What may follow every verb that is a request: the machine, or the bus alone, and what carries the request out; then
/// the words, options and flags that the table has for `request`, which become its arguments.
void request_words(const Verb& verb, Options& options, const std::shared_ptr<command::Request>& request,
                   RequestWords which = {});
/// The machine, or the bus alone, and what carries requests out: for a verb that makes its own requests.
void bus_words(const Verb& verb, Options& options, RequestWords which = {});
/// One line, from the table.
[[nodiscard]] std::string help_of(const std::string& request);
/// Words as the lines of one argument.
[[nodiscard]] std::string one_a_line(const std::vector<std::string>& words);

}  // namespace berth::cli
