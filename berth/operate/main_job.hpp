/// The order in which the parts of a network work (`berth/operate/network.hpp` says it in words).
#pragma once

#include <string>

#include "berth/operate/parts.hpp"
#include "berth/operate/port_health.hpp"

namespace berth::operate {

/// How often is searched for what slots wait for: the more rounds found nothing, the seldomer.
class SearchPace {
 public:
  /// What the bus shows: a device that comes, goes or boots changes it.
  struct View {
    std::size_t found = 0;
    std::uint64_t lives = 0;     ///< of the slots
    std::uint64_t boot_ups = 0;  ///< of all node-IDs
    unsigned heard = 0;          ///< node-IDs under which anything ever was
    friend bool operator==(const View&, const View&) = default;
  };
  /// At each look. True: something changed; the next round comes soon.
  bool look(const View& now) noexcept;
  /// A person said so.
  void hurry() noexcept { in_vain_ = 0; }
  /// A round begins. In how many `probe_period`s may the next?
  [[nodiscard]] int round() noexcept;
  /// A device may be switched on at any moment: it is asked for often.
  [[nodiscard]] bool is_eager() const noexcept { return in_vain_ <= eager; }
  static constexpr int usual = 8;
  static constexpr int longest = 64;

 private:
  static constexpr unsigned eager = 3;  // rounds without a change after which it gets seldomer
  View seen_;
  unsigned in_vain_ = 0;
};

class MainJob {
 public:
  MainJob(NetworkParts& parts, PortHealth& port) noexcept : p_(parts), port_(port) {}

  /// Never ends by itself.
  rt::Task<void> run();
  /// Nothing to do now but to watch.
  [[nodiscard]] bool idle() const noexcept { return idle_; }
  /// `run` was cancelled.
  void ended() noexcept { idle_ = false; }

  /// One round without a start (`berth bind`). Waits for its turn. Errors: `not_found` a slot is without its device.
  rt::Task<Result<void>> bind_once(std::string method);
  /// The same, after every node-ID that LSS can take away was taken away. Errors: also `invalid` not `confirmed`;
  /// `unsupported` Berth does not command this bus.
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
  rt::Time optional_at_{};               // what optional slots lack is not looked for before: it may never come
  unsigned blanks_ = 0;                  // as they were at the last retry
  unsigned unfinished_looks_ = 0;        // retries since one was tried
};

}  // namespace berth::operate
