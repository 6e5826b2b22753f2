/// The planners on CiA 305 Fastscan, with and without feedback: one walk of the tree of addresses.
///
/// Slaves are unmodified: a slave answers 51h when it is at the part asked and the upper bits fit, and then goes to the
/// part named by LSSNext (docs/protocols/cia305.md §Fastscan). So
///
/// - a question about some of the bits has LSSNext = LSSSub: no device moves, none is selected;
/// - a part that is known is confirmed with one message that moves on the devices that fit (S4.9). Since the last 80h
///   only *one* value is ever asked so for each part, and after silence the next round begins with 80h: else devices
///   that moved unheard would stand among those of another value, and a wrong address could be put together;
/// - an exact serial number with LSSNext 0 selects the device. Then it says its serial number itself (5Dh; and each
///   part of which several values were confirmed in this search), and that no other is in configuration
///   (`lss::prove_alone`): an answer that came late, twice, or was forged makes no device found, nor does a device that
///   answers every question (CANopenNode in configuration; `Report::unproven`). A device that was perhaps selected
///   unheard is sent back to waiting before another is selected.
///
/// A round is: 80h, the known parts, then the serial numbers below them until no more devices are found there, or until
/// more than `Options::retries` places in a row have answered and led to no device. An answer to the next 80h begins
/// the next round; the search is over when 80h stays unanswered for the longest window. So wrong silence, a device that
/// joins meanwhile, or one that forgets the part it is at, cost time only.
///
/// Found devices leave the tree: they get a node-ID from the `Assigner`, and `04 00`, before the next request. No
/// device stays in configuration while others are searched for. One that gets none (no assigner, a refusal, clones)
/// waits and answers on whatever it fits: from then on the walk asks the places beside such devices only, 128 questions
/// for the first and fewer for each further one of its type, and ends with `Report::End::held`: 80h is answered, so
/// nothing can say that these are all. With learnt windows and many devices of a type this is the slower way.
///
/// A slave that answers Fastscan whatever node-ID it has (Lely core's) is taken out by none. Each selected device tells
/// its node-ID (5Eh): a device that has one keeps it. It is reported once, unless it is registered, and the walk goes
/// round it as above, by the names of the registered first; where all of those have a node-ID it ends `complete`. That
/// a device is met again is no sign of a clone; two answers to one question are.
///
/// Within a part the walk asks for the lower half first and concludes the upper one from silence; every eighth
/// conclusion in a row is checked by a question that must be answered, and a path on which no device answers any more
/// is left at the deepest place that still answers. After a device: the next serial number, then its neighbourhood
/// (while either has been worth its question), then the places where two were heard where only one went on.
///
/// With feedback every chunk that was heard is a child to go to, also one that was heard after the next request had
/// been chosen. Devices without feedback among them are found by bits in the rounds after, also when a device whose
/// feedback leads nowhere remains: two rounds in a row that found no device, and the next ones go by bits alone.
#pragma once

#include <memory>

#include "berth/discovery/asker.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/discovery/walk_memory.hpp"

namespace berth::discovery {

class Walker final : public Discovery {
 public:
  /// `feedback`: `planner_feedback`, else `planner_fastscan`, which listens to no feedback.
  Walker(const Services& services, bool feedback);
  ~Walker() override;
  [[nodiscard]] Method method() const noexcept override {
    return feedback_ ? Method::planner_feedback : Method::planner_fastscan;
  }
  /// A registered device that answers has no node-ID: it is found too.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;
  /// Of the last `find` or `anybody`: a device sent feedback.
  [[nodiscard]] bool heard_feedback() const noexcept { return heard_feedback_; }
  [[nodiscard]] const Latency& latency() const noexcept { return asker_.latency(); }

 private:
  class Search;
  Services services_;
  Asker asker_;
  walk::Memory memory_;
  bool feedback_;
  bool goes_on_ = false;  // the last search ended with `more`
  bool busy_ = false;
  bool heard_feedback_ = false;
};

}  // namespace berth::discovery
