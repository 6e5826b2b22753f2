/// Verbs that are one request. Their help, and what may stand after them, are the table's (berth/command/verbs.hpp):
/// words, options and flags become the request's arguments.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "berth/command/request.hpp"
#include "options.hpp"
#include "verb.hpp"

namespace berth::cli {

/// What of the words of requests counts for one.
struct RequestWords {
  bool up = true;        ///< --up: what is asked can be asked of a running machine
  bool alone = true;     ///< --eds, --bitrate: a bus without a machine file can be asked
  bool bit_rate = true;  ///< --bitrate is a number
  MachineWords machine{};
};

/// A verb and the request that it makes.
class RequestVerb {
 public:
  /// Makes the request whole when everything is read; what is wrong, empty when it is good.
  using Finish = std::function<std::string(command::Request&)>;

  /// `request`: its name in the table.
  RequestVerb(const Verb& parent, Options& options, const std::string& name, const std::string& request,
              Finish finish = {}, RequestWords which = {});
  void footer(const std::string& text) const { verb_.footer(text); }
  /// For words of the form `own`, which `Finish` reads.
  [[nodiscard]] const Verb& verb() const noexcept { return verb_; }

 private:
  std::shared_ptr<command::Request> request_;
  Verb verb_;
};

/// What stands after every verb that is a request: the machine, or the bus alone, and what carries it out; and, of the
/// verb that `request` names, the words, options and flags of the table, which become its arguments.
void request_words(const Verb& verb, Options& options, const std::shared_ptr<command::Request>& request,
                   RequestWords which = {});
/// The machine, or the bus alone, and what carries it out, of a verb that makes requests of its own.
void bus_words(const Verb& verb, Options& options, RequestWords which = {});
/// One line, of the table.
[[nodiscard]] std::string help_of(const std::string& request);

}  // namespace berth::cli
