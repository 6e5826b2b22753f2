/// The rights of a CiA 309-3 gateway's clients: the roles of the buses, and the user's permissions. Internal to room
/// `serve`.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/command/request.hpp"
#include "berth/serve/cia309.hpp"
#include "berth/tree/session.hpp"

namespace berth::serve::cia309 {

class Net;
class Pdos;

/// Shared by the conversations of one gateway. Must outlive them, like the session.
struct House {
  tree::Session* session = nullptr;
  bool commands = false;   ///< a user lets clients change real devices: NMT, SDO download, PDO, LSS
  bool confirmed = false;  ///< a user confirmed commands that disturb operational devices on real buses
  /// Called with the reason for each refusal; may be empty.
  std::function<void(const std::string&)> tell{};
  std::vector<const Pdos*> pdos{};  ///< of all conversations
};

/// The result of a request.
struct Outcome {
  std::string text{};  ///< whole lines before the reply
  std::string last = "OK";
  std::optional<Code> code{};
  std::optional<std::uint32_t> abort{};
  [[nodiscard]] bool failed() const noexcept { return code.has_value() || abort.has_value(); }
  static Outcome value(std::string last) { return {{}, std::move(last), {}, {}}; }
  static Outcome refused(Code code) { return {{}, {}, code, {}}; }
  static Outcome aborted(std::uint32_t abort) { return {{}, {}, {}, abort}; }
};

/// A command whose node-ID may be 0: all devices.
[[nodiscard]] bool is_for_all_nodes(Verb verb) noexcept;
[[nodiscard]] bool is_lss(Verb verb) noexcept;
/// The verb of berth/command/verbs.hpp whose rights it needs; empty: it concerns the conversation, or only listens.
[[nodiscard]] std::string_view verb_of(Verb verb) noexcept;

/// Each refusal is reported with its reason.
class Permits {
 public:
  /// `house` must outlive this.
  explicit Permits(const House& house) noexcept : house_(&house) {}
  /// The bus's role: frames, or commands to devices.
  [[nodiscard]] bool may_send(const Net& net, bool commands) const;
  /// On a real bus a client may command devices only with a user's permission.
  [[nodiscard]] bool allowed(const Request& request, const Net& net) const;
  void tell(const std::string& text) const;
  [[nodiscard]] const House& house() const noexcept { return *house_; }

 private:
  const House* house_;
};

}  // namespace berth::serve::cia309
