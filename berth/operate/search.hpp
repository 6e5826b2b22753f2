/// One search for devices that no slot knows, by the bus's method, and its reports.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/interruptions.hpp"
#include "berth/operate/search_methods.hpp"

namespace berth::operate {

/// The devices that a search found, for `berth scan` and `berth lss find`.
struct NewDevices {
  std::vector<discovery::Found> found;
  bool complete = true;
  std::string end;  ///< why it is not complete
};

class Search final : private nodeid::DiscoveryObserver, private discovery::Observer {
 public:
  Search(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Lending& lending);

  /// Devices found from now on are news, unless the previous search found them too.
  void begin();
  /// The last search found a device that was not reported before.
  [[nodiscard]] bool has_news() const noexcept { return news_; }

  /// RAND, by Berth's planner, which needs a fraction of the questions; as published only if the method is named.
  rt::Task<void> by_rand();
  /// By all other methods, with `also_configured` also for devices with a node-ID. False: the search failed.
  rt::Task<bool> by_rest(bool also_configured);
  /// The same for devices without a node-ID, one slice of it, for a bus at rest: working devices answer Fastscan too,
  /// and each costs some twenty questions. False: the search failed.
  rt::Task<bool> by_slice();
  /// The last `by_slice` did not finish its search, and found nothing.
  [[nodiscard]] bool has_slices_left() const noexcept { return slices_left_; }
  /// By the bus's `discovery =`. False: there is no such method, or the search failed.
  rt::Task<bool> by_method();
  /// The last `by_rand` was interrupted (`Agenda::search_open`): the next call continues it.
  [[nodiscard]] bool rand_is_open() const noexcept { return rand_open_; }
  /// Continues an unfinished search (`Agenda::search_open`) other than RAND.
  rt::Task<bool> go_on();
  /// One question of RAND: which devices are new?
  rt::Task<bool> anybody_by_rand();

  /// Finds all devices that `discovery =` reaches, without regard to slots and without remembering anything. The turn
  /// must be held.
  rt::Task<Result<NewDevices>> find_new();

 private:
  // The progress of a long search, all its parts together.
  struct Pace {
    rt::Time began{};
    std::size_t found = 0;
    rt::Time tell_at{};  // next report
  };
  // How the search under way gets on.
  struct Advance {
    discovery::Progress furthest{};
    unsigned idle = 0;  // slices in a row that got no further and found nothing
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
  Pace pace_;
  Advance advance_;
  Interruptions interruptions_;
  std::optional<rt::Time> interruptible_since_;  // empty: no search is under way that may be interrupted
  bool interrupted_ = false;
  bool rand_open_ = false;
  bool unfinished_ = false;  // the next search is the rest of the last one
  bool news_ = false;
  bool sliced_ = false;
  bool slices_left_ = false;
  bool open_configured_ = false;  // the unfinished search also looks for devices with a node-ID
};

}  // namespace berth::operate
