/// The order in which the parts of a network work (`berth/operate/network.hpp` describes it).
#pragma once

#include <string>

#include "berth/operate/parts.hpp"
#include "berth/operate/port_health.hpp"

namespace berth::operate {

/// How often to search for what slots wait for: the more rounds found nothing, the more rarely.
class SearchPace {
 public:
  /// What is visible on the bus: it changes when a device comes, goes or boots.
  struct View {
    std::size_t found = 0;
    std::uint64_t lives = 0;     ///< of the slots
    std::uint64_t boot_ups = 0;  ///< of all node-IDs
    unsigned heard = 0;          ///< node-IDs under which a node was ever heard
    friend bool operator==(const View&, const View&) = default;
  };
  /// Called at each look. True: something changed; the next round comes soon.
  bool look(const View& now) noexcept;
  /// A user asked for it.
  void hurry() noexcept { in_vain_ = 0; }
  /// A round begins. Returns the number of `probe_period`s until the next.
  [[nodiscard]] int round() noexcept;
  /// A device may be switched on at any moment: searches are frequent.
  [[nodiscard]] bool is_eager() const noexcept { return in_vain_ <= eager; }
  static constexpr int usual = 8;
  static constexpr int longest = 64;

 private:
  static constexpr unsigned eager = 3;  // rounds without a change before the pace slows
  View seen_;
  unsigned in_vain_ = 0;
};

class MainJob {
 public:
  MainJob(NetworkParts& parts, PortHealth& port) noexcept : p_(parts), port_(port) {}

  /// Never ends by itself.
  rt::Task<void> run();
  /// Nothing to do now but watch.
  [[nodiscard]] bool idle() const noexcept { return idle_; }
  /// `run` was cancelled.
  void ended() noexcept { idle_ = false; }

  /// One round without a start (`berth bind`). Waits for the turn. Errors: `not_found` a slot's device is missing.
  rt::Task<Result<void>> bind_once(std::string method);
  /// The same, after taking away every node-ID that LSS can. Errors: also `invalid` not `confirmed`; `unsupported`
  /// Berth does not command this bus.
  rt::Task<Result<void>> bind_from_scratch(bool confirmed);

 private:
  rt::Task<void> work(bool first);
  rt::Task<void> opening();
  rt::Task<void> round(bool first);
  void tell_whether_empty(Seat& seat);
  rt::Task<void> ask_the_troubled();
  rt::Task<void> look_again_at(Seat& seat);
  rt::Task<void> carry_out();
  rt::Task<void> seat_the_configured();
  rt::Task<void> start();
  rt::Task<void> watch();
  rt::Task<bool> look();
  rt::Task<void> handle_what_came();
  rt::Task<bool> act_on_wakes(std::optional<Wake> wake);
  rt::Task<Result<void>> blank_all();
  [[nodiscard]] rt::Duration look_period() const noexcept;
  [[nodiscard]] bool retry_due();
  [[nodiscard]] bool has_trouble() const;
  [[nodiscard]] bool lacks_optional() const;
  [[nodiscard]] bool waits_for_unfinished() const;
  [[nodiscard]] Result<void> all_there() const;

  NetworkParts& p_;
  PortHealth& port_;
  bool idle_ = false;
  SearchPace pace_;
  int retry_pause_ = SearchPace::usual;  // in `probe_period`s
  rt::Time optional_at_{};               // what optional slots lack may never come: no search for it before this time
  unsigned blanks_ = 0;                  // as of the last retry
  unsigned unfinished_looks_ = 0;        // retries since one was tried
};

}  // namespace berth::operate
