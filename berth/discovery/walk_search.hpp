/// One search of a `Walker`. Internal to `discovery`.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "berth/discovery/prefix.hpp"
#include "berth/discovery/walk.hpp"
#include "berth/lss/select_alone.hpp"

namespace berth::discovery {

class Walker::Search {
 public:
  Search(Walker& walker, const Known& known, const Options& options);
  /// A device that is still in configuration goes back to waiting, however the search ends.
  ~Search();
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;
  [[nodiscard]] rt::Task<Result<Report>> run();

 private:
  /// A place to go on at.
  struct Open {
    enum class Why : std::uint8_t {
      maybe,    // a device may be there
      heard,    // feedback told so; to be asked for what is below
      answered  // a device answered for it
    };
    Prefix at;
    Why why = Why::maybe;
  };
  /// A vendor, product and perhaps revision that may be there.
  struct Path {
    std::array<std::uint32_t, 4> part{};
    unsigned parts = 2;  // known: 2, 3, or 4 for a whole address
  };
  /// Whether a kind of question has been worth asking.
  struct Worth {
    unsigned tries = 0;
    unsigned hits = 0;
    [[nodiscard]] bool ask() const noexcept { return tries < 3 + 12 * hits; }
    void note(bool hit) noexcept {
      ++tries;
      if (hit) ++hits;
    }
  };
  enum class Outcome : std::uint8_t { nobody, found, late };
  /// The first parts of an address that was put aside.
  struct Place {
    std::array<std::uint32_t, 3> part{};
    unsigned parts = 0;
    friend bool operator==(const Place&, const Place&) = default;
  };
  enum class Stand : std::uint8_t { there, vacant, nobody };
  struct Silent {
    Place place;
    Prefix at;
    rt::Time asked{};
  };

  // Questions
  rt::Task<Heard> ask_once(Prefix at, unsigned next, Wait wait);
  [[nodiscard]] bool one_only() const noexcept { return alone_ >= 4; }
  void count(const Heard& heard) noexcept;
  void elsewhere() noexcept;
  void step_aside(Prefix& at);
  rt::Task<Heard> ask(Prefix at, unsigned next, Wait wait);
  rt::Task<Heard> start();
  rt::Task<bool> enter(std::uint32_t value);
  rt::Task<bool> enter_leaf();
  void take_feedback(const std::vector<lss::FeedbackValue>& heard, unsigned sub, Prefix at, std::vector<Prefix>& to);
  void open(Prefix at, Open::Why why);
  // The walk
  rt::Task<void> round();
  rt::Task<void> serials();
  rt::Task<void> by_name();
  rt::Task<void> registered_by_name();
  rt::Task<bool> place(Open place);
  rt::Task<bool> anybody_left();
  rt::Task<std::optional<Prefix>> others_left();
  rt::Task<void> around();
  rt::Task<Outcome> guess(std::uint64_t serial, Worth& worth);
  [[nodiscard]] std::optional<std::uint32_t> next_of_row(std::uint32_t serial, bool up) const;
  rt::Task<bool> again_at_serials();
  rt::Task<bool> lead_to_serials();
  rt::Task<bool> descend(Prefix at, unsigned answers);
  rt::Task<bool> down_feedback(Prefix& at);
  rt::Task<bool> back();
  // Devices
  rt::Task<Outcome> settle(std::uint32_t serial);
  rt::Task<Outcome> selected(LssAddress device);
  rt::Task<NodeId> give(LssAddress device);
  rt::Task<void> release();
  [[nodiscard]] lss::AloneOptions alone_options() const noexcept;
  void keep(const Found& device);
  rt::Task<NodeId> active_id();
  rt::Task<Outcome> stays(const Found& device, bool told);
  void put_aside(const LssAddress& device, bool has_node_id);
  // Beside the devices that were put aside
  rt::Task<void> beside();
  rt::Task<Stand> stand_at(Place place);
  [[nodiscard]] bool is_vacant(const Place& place) const;
  void forget_silence(rt::Time answered);
  rt::Task<bool> ask_beside(Place place);
  rt::Task<bool> row_beside();
  rt::Task<void> below(Prefix at);
  // What is known
  [[nodiscard]] const Path* choose() const;
  [[nodiscard]] bool fits_chain(const Path& path) const;
  [[nodiscard]] bool absent(const Path& path) const;
  [[nodiscard]] bool chunk_heard(std::uint32_t value) const;
  [[nodiscard]] bool is_found(const LssAddress& device) const;
  [[nodiscard]] bool is_registered(const LssAddress& device) const;
  [[nodiscard]] bool is_aside(const LssAddress& device) const;
  [[nodiscard]] bool over() const;
  [[nodiscard]] LssAddress address(std::uint32_t serial) const { return {chain_[0], chain_[1], chain_[2], serial}; }
  void broken(Error error) noexcept;
  bool stops() noexcept;

  Walker& walker_;
  Asker& asker_;
  lss::Master& lss_;
  const Known& known_;
  const Options& options_;
  Report report_{};
  bool broken_ = false;   // nothing more is asked
  bool stopped_ = false;  // because the observer said so: no error
  Error error_{};

  std::vector<Path> paths_;
  std::vector<Path> absent_;             // no device moved on to these in this search
  std::array<bool, 3> varied_{};         // several values of this part were asked in this search
  std::array<std::uint32_t, 4> used_{};  // the last asked value of each part
  std::array<bool, 4> has_used_{};

  std::array<std::uint32_t, 4> chain_{};  // confirmed since the last 80h
  unsigned sub_ = 0;                      // the part that is walked
  Prefix asked_{};                        // what the last question's feedback is below of
  unsigned asked_sub_ = 0;
  std::vector<Prefix> children_;  // heard below the prefix just asked
  std::vector<Open> open_;
  std::vector<Prefix> seen_;     // heard of in this part
  std::vector<Prefix> anchors_;  // on the path, each was answered
  Prefix leaf_{};
  unsigned careful_ = 0;    // so many steps down with the longest window
  unsigned alone_ = 0;      // questions in a row, each below the one before, that got one answer
  bool overtaken_ = false;  // no device entered, but the question before it was answered
  bool below_ = false;      // the last question was such a one
  unsigned backs_ = 0;
  unsigned failed_ = 0;           // places in a row at which a device was heard and none found
  unsigned entered_answers_ = 0;  // to the message that moved on to this part
  Haste haste_;
  Worth row_;
  Worth next_;
  Worth near_;
  bool by_bits_ = false;     // feedback has led nowhere: it hides devices that send none
  bool hints_fail_ = false;  // equal answers fall into one here: their number says nothing
  bool forgets_ = false;     // slaves forget their part at `04 00`
  bool remembering_tested_ = false;
  std::array<std::uint32_t, 4> last_chain_{};
  std::size_t last_round_found_ = 0;
  std::vector<LssAddress> aside_;  // known, and they answer again
  std::vector<Silent> doubted_;    // silent when they were asked in haste
  bool patient_ = false;           // haste has led nowhere
  bool wholly_ = false;            // again and again
  std::vector<Place> vacant_;      // no device is led there
  std::vector<Silent> silent_;     // asked beside those, and silent
  bool set_aside_ = false;         // in this round: it can tell nothing more
  bool exhausted_ = false;         // no device is beside those
  bool nameless_ = false;          // one of those has no node-ID
  bool some_stay_ = false;         // whatever node-ID they have
  Worth stayers_;                  // registered devices, asked for by name: they answer although they have a node-ID
  bool held_ = false;              // a device may be in configuration
};

}  // namespace berth::discovery
