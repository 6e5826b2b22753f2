/// One search for devices that no slot knows, by the bus's method, and what is told of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/search_methods.hpp"

namespace berth::operate {

/// The devices that a search found, for `berth scan` and `berth lss find`.
struct NewDevices {
  std::vector<discovery::Found> found;
  bool complete = true;
  std::string end;  ///< how it ended, when it is not complete
};

class Search final : private nodeid::DiscoveryObserver, private discovery::Observer {
 public:
  Search(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Lending& lending);

  /// What is found from now on is news, unless the search before found it too.
  void begin();
  /// The last search found a device that was not told before.
  [[nodiscard]] bool has_news() const noexcept { return news_; }

  /// RAND, by Berth's planner, as published only by name: the planner asks a fraction of it.
  rt::Task<void> by_rand();
  /// Whatever else devices speak, and `also_configured` those with a node-ID. False: the search failed.
  rt::Task<bool> by_rest(bool also_configured);
  /// The same for devices without a node-ID, a slice of it: the bus is at rest, and those at work answer Fastscan, each
  /// at the cost of some twenty questions. False: the search failed.
  rt::Task<bool> by_slice();
  /// The last `by_slice` was not the last one of its search, and found nobody.
  [[nodiscard]] bool has_slices_left() const noexcept { return slices_left_; }
  /// `discovery =`. False: there is no such method, or the search failed.
  rt::Task<bool> by_method();
  /// The last `by_rand` was broken off (`Agenda::search_open`): called again, it goes on.
  [[nodiscard]] bool rand_is_open() const noexcept { return rand_open_; }
  /// A search that had no end yet (`Agenda::search_open`), and not by RAND.
  rt::Task<bool> go_on();
  /// One question of RAND: which devices are new?
  rt::Task<bool> anybody_by_rand();

  /// All of them, as far as `discovery =` reaches; no slot is thought of and nothing is remembered. The turn must be
  /// held.
  rt::Task<Result<NewDevices>> find_new();

 private:
  // How fast a long search gets on, all its parts together.
  struct Pace {
    rt::Time began{};
    std::size_t found = 0;
    rt::Time tell_at{};  // it is told again then
  };
  // By what the bus or a person tells meanwhile.
  struct Interruptions {
    unsigned count = 0;  // since the last search that came to its end, or got on
    discovery::Progress broken_at{};
    rt::Time counted_until{};                 // they are counted anew from then on
    std::optional<rt::Time> allowed_since{};  // empty: no search is under way that may be broken off
    bool now = false;
  };
  rt::Task<Result<void>> find_the_rest(discovery::Discovery& way, NewDevices& all);
  rt::Task<bool> by(discovery::Discovery& way, unsigned slice = 0);
  void take(const discovery::Report& report);
  void tell_found(const Identity& device, bool clone);
  void tell_end(const discovery::Report& report);
  void tell_progress();
  [[nodiscard]] std::string outlook() const;
  [[nodiscard]] bool gets_on();

  void phase(const nodeid::PhaseEvent&) noexcept override {}
  void found(const nodeid::Discovered& device) noexcept override;
  void restarted(unsigned, rt::Time) noexcept override {}
  void found(const discovery::Found& device) noexcept override;
  void progress(const discovery::Progress& progress) noexcept override { now_ = progress; }
  bool goes_on() noexcept override;

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Lending& lending_;
  SearchMethods methods_;
  std::vector<Identity> heard_of_;      // found by this search
  std::vector<Identity> known_before_;  // by the one before
  discovery::Progress now_{};
  discovery::Progress before_{};
  Pace pace_;
  unsigned idle_ = 0;  // slices in a row that brought nothing
  Interruptions stops_;
  bool rand_open_ = false;
  bool news_ = false;
  bool sliced_ = false;
  bool slices_left_ = false;
  bool open_configured_ = false;  // the search that is open looks for devices with a node-ID too
};

}  // namespace berth::operate
