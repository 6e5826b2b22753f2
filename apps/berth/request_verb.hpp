/// Verbs that are one request: what may stand behind them becomes the request's arguments.
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

  /// `request`: its name in `command::execute`.
  RequestVerb(const Verb& parent, Options& options, const std::string& name, const std::string& request,
              const std::string& help, Finish finish = {}, RequestWords which = {});
  Word word(const std::string& names, const std::string& key, const std::string& help) const;
  Word flag(const std::string& names, const std::string& key, const std::string& help) const;
  void footer(const std::string& text) const { verb_.footer(text); }
  /// For words that `Finish` reads.
  [[nodiscard]] const Verb& verb() const noexcept { return verb_; }

 private:
  std::shared_ptr<command::Request> request_;
  Verb verb_;
};

/// What stands behind every verb that is a request: the machine, or the bus alone, and what carries it out.
void request_words(const Verb& verb, Options& options, RequestWords which = {});

}  // namespace berth::cli
