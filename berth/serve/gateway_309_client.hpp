/// One conversation of CiA 309-3 with the networks of a session: takes lines, carries them out, one after the other in
/// the order in which they came, and says a reply for each, with indications between them.
///
///     serve::Conversation309 client(house, [&](std::string_view text) { stream.put(text); }, [&] { more(); });
///     client.take("[1] 5 read 0x1000 0 u32");
///
/// Every conversation is a gateway of its own: default net and node, time-outs, PDOs, guarding and heartbeat
/// supervision are its own and end with it. Net n is the n-th bus of the machine file.
///
/// It does nothing that `operate`'s commands would not: roles hold, LSS waits for its turn. On a real bus it only reads
/// and asks unless `House309::commands`; what disturbs operational devices there is refused (102) unless
/// `House309::confirmed`. A conversation that has put devices into LSS
/// configuration state keeps the turn until `lss_switch_glob 0`, for `lss_patience` after the last LSS command, or
/// until the conversation ends; then all are told to wait.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/command/request.hpp"
#include "berth/lss/frames.hpp"
#include "berth/operate/session.hpp"
#include "berth/rt/scope.hpp"
#include "berth/serve/gateway_309.hpp"

namespace berth::serve {

class Pdos309;

/// What the conversations of one gateway share. Must stay, and the session too.
struct House309 {
  operate::Session* session = nullptr;
  bool commands = false;   ///< a person lets clients change real devices: NMT, SDO download, PDO, LSS
  bool confirmed = false;  ///< a person has confirmed what disturbs operational devices on real buses
  /// Told in words why something was refused; may be empty.
  std::function<void(const std::string&)> tell{};
  std::vector<const Pdos309*> pdos{};  ///< of all conversations
};

class Conversation309 {
 public:
  static constexpr std::size_t most_lines = 64;                           ///< that wait; then it is `full`
  static constexpr std::size_t longest_command = std::size_t{1} << 20U;   ///< bytes, as far as `set command_size` goes
  static constexpr std::size_t usual_command = std::size_t{1} << 16U;     ///< before it
  static constexpr std::size_t longest_value = std::size_t{1} << 20U;     ///< bytes of an object
  static constexpr rt::Duration turn_patience = std::chrono::seconds(5);  ///< for a network that the main job uses
  static constexpr rt::Duration lss_patience = std::chrono::seconds(30);
  static constexpr rt::Duration status_period = std::chrono::milliseconds(250);

  /// `say` gets whole lines with their CR LF, from the executor or from within `take`; `more` says that it takes
  /// lines again. Neither may destroy the conversation.
  Conversation309(House309& house, std::function<void(std::string_view)> say, std::function<void()> more);
  ~Conversation309();
  Conversation309(const Conversation309&) = delete;
  Conversation309& operator=(const Conversation309&) = delete;

  /// A line without its end. Not while it is `full`.
  void take(std::string_view line);
  /// A line that was longer than `command_size`; `beginning` is what was kept of it.
  void take_too_long(std::string_view beginning);
  /// Too much waits: no line before `more` is called.
  [[nodiscard]] bool full() noexcept;
  [[nodiscard]] std::size_t command_size() const noexcept { return command_size_; }
  /// Nothing waits and nothing is under way.
  [[nodiscard]] bool idle() const noexcept { return queue_.empty() && !busy_; }

 private:
  class Net;
  friend class Net;
  template <void (Conversation309::*Method)()>
  class Call final : public rt::Job {
   public:
    explicit Call(Conversation309& owner) noexcept : owner_(owner) {}
    void run() noexcept override { (owner_.*Method)(); }

   private:
    Conversation309& owner_;
  };
  /// What became of a request.
  struct Outcome {
    std::string text{};  ///< whole lines before the reply
    std::string last = "OK";
    std::optional<Code309> code{};
    std::optional<std::uint32_t> abort{};
    [[nodiscard]] bool failed() const noexcept { return code.has_value() || abort.has_value(); }
    static Outcome value(std::string last) { return {{}, std::move(last), {}, {}}; }
    static Outcome refused(Code309 code) { return {{}, {}, code, {}}; }
    static Outcome aborted(std::uint32_t abort) { return {{}, {}, {}, abort}; }
  };

  void enqueue(Line309 line);
  void next();
  void over();
  void out_of_time();
  void watch();
  void reply(const Outcome& outcome);
  void tell(const std::string& text) const;
  [[nodiscard]] rt::Executor& executor() const noexcept { return house_->session->executor(); }

  // gateway_309_client.cpp
  rt::Task<void> carry_out();
  rt::Task<Outcome> perform(const Request309& request);
  Outcome settle(const Request309& request);
  [[nodiscard]] std::optional<Code309> aim(Request309& request) const;
  [[nodiscard]] bool immediate(Verb309 verb) const noexcept;
  [[nodiscard]] bool may_send(const Net& net, bool commands) const;
  [[nodiscard]] bool allowed(const Request309& request, const Net& net) const;
  [[nodiscard]] bool undisturbing(const command::Request& request) const;
  Outcome of_net(const Request309& request, Net& net);
  Outcome init(Net& net, std::uint32_t index);
  Outcome set_pdo(const Request309& request, Net& net);
  Outcome write_pdo(const Request309& request, Net& net);
  rt::Task<Outcome> read_pdo(std::uint16_t number, Net& net);
  rt::Task<Outcome> read(const Request309& request, Net& net);
  rt::Task<Outcome> write(const Request309& request, Net& net);
  rt::Task<Outcome> command(const Request309& request, Net& net);
  [[nodiscard]] Outcome failed(const Error& error, Net& net) const;
  [[nodiscard]] command::Request request_for(const Net& net, std::string verb) const;

  // gateway_309_lss.cpp
  class Ids;
  rt::Task<Outcome> lss(const Request309& request, Net& net);
  rt::Task<Outcome> lss_service(const Request309& request, Net& net);
  rt::Task<Outcome> switch_global(bool configuration, Net& net);
  rt::Task<Outcome> switch_selective(LssAddress address, Net& net);
  rt::Task<Outcome> set_node(NodeId id, Net& net);
  rt::Task<Outcome> configure(const Request309& request, Net& net);
  rt::Task<Outcome> inquire(const Request309& request, Net& net);
  rt::Task<Outcome> identify(const Request309& request, Net& net);
  rt::Task<Outcome> slowscan(const Request309& request, Net& net);
  rt::Task<Outcome> fastscan(const Request309& request, Net& net);
  rt::Task<Outcome> allnodes(const Request309& request, Net& net);
  rt::Task<bool> is_taken(NodeId id, Net& net);
  rt::Task<Result<bool>> anybody_in(lss::IdentifyRanges ranges, Net& net);
  [[nodiscard]] bool may_select(const LssAddress& address, Net& net) const;
  [[nodiscard]] bool may_configure(Net& net) const;
  [[nodiscard]] Outcome lss_failed(const Error& error, Net& net, Code309 refused) const;
  [[nodiscard]] static bool heard_lately(NodeId id, const Net& net);
  rt::Task<bool> take_turn(Net& net);
  static void release(Net& net) noexcept;
  void release_turns();

  House309* house_;
  std::function<void(std::string_view)> say_;
  std::function<void()> more_;
  std::vector<std::unique_ptr<Net>> nets_;
  std::optional<std::uint16_t> net_;
  std::optional<std::uint8_t> node_;
  std::size_t command_size_ = usual_command;
  rt::Duration command_timeout_{0};  // 0: none
  std::deque<Line309> queue_;
  std::size_t queued_bytes_ = 0;  // of values in `queue_`
  bool busy_ = false;
  bool full_ = false;
  Request309 current_;
  Outcome outcome_;
  Call<&Conversation309::next> next_{*this};
  Call<&Conversation309::over> over_{*this};
  Call<&Conversation309::out_of_time> out_of_time_{*this};
  Call<&Conversation309::watch> watch_{*this};
  Call<&Conversation309::release_turns> release_{*this};
  rt::Scope scope_;  // last: its task uses the rest
};

}  // namespace berth::serve
