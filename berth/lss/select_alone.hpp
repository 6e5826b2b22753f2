/// Brings one device into LSS configuration and proves that it is the only one there: common to all paths that
/// configure a device by LSS. `places::Binder` gives slots their node-IDs, `configure_alone` gives those of loans and
/// of found devices. No proof is needed for:
/// - settings meant for all devices in configuration (a new bit rate, `11 FF`)
/// - the procedures of papers and standards as published (`discovery = "fastscan"`)
/// - single services requested by the user or by a client of CiA 309
///
///     auto alone = co_await lss::select_alone(master, device, options);
///     if (!alone) co_return fail(alone.error());            // the bus
///     if (*alone != lss::Selection::alone) co_return ...;   // all devices are waiting again, unchanged
///     auto given = co_await lss::configure_alone(master, device, id, store, options);  // 11h, 17h, 04 00
///
/// or 11h, 13h, 17h of your own, followed by `04 00` whatever their result.
///
/// Equal devices without a serial number have one address. Those that have a node-ID stay in LSS waiting when Fastscan
/// selects the one without (`AloneOptions::without_node_id`). Several without one are `clones`, unless they answer at
/// one instant.
///
/// `select_alone` sends `04 00`, because CiA 305 serves 40h to 43h in LSS waiting only (docs/protocols/cia305.md
/// §State table), then 40h to 43h, and proves. Each further attempt begins with `04 00` too: the device may be in
/// configuration and its 44h lost. `prove_alone` only proves, for a device that Fastscan's last match brought into
/// configuration. That may be done at once: 5Dh is served in configuration. To use 40h to 43h on such a device,
/// `select_alone` sends the `04 00` that this needs.
///
/// Reason for the proof: `04 00` has no answer. A device that lost it (its receive buffer was full, it was writing its
/// memory, it was selected unnoticed) is in configuration together with the selected one. Both execute 11h and get the
/// same node-ID at the next `04 00`.
///
/// The proof asks for the serial number (5Dh), and for those parts of the address (5Ah to 5Ch) in which another device
/// with the same serial number could differ. Every question must have exactly one answer, the device's own.
/// - On a calm bus the questions go in a row: each follows the answer to the one before, the serial number last, and
///   all share its whole window. Calm means that for four of the longest windows no service went unanswered, no device
///   was lost, and no unrequested frame came on 7E4h. If anything but the one answer to each is heard, the questions
///   are repeated one by one.
/// - Else one by one, the serial number first, each for a whole window: a device that is deaf while it stores receives
///   again meanwhile, and answers 17h. On a calm bus such answers were listened for before.
///
/// - Different answers, or an answer of another device: `not_alone`.
/// - Two equal answers come from another device in configuration, or from a repeated frame; the part is asked again.
///   After three times the other parts are asked: if all are the device's, `clones`; if one differs or has no answer,
///   `not_alone`. Else all is asked once more.
/// - A frame on 7E4h that no question asked for comes from a device that receives again and missed the earlier
///   questions: all is asked once more.
/// - Two devices with the same answer may merge into one frame on the wire (one identifier, one content, one instant).
///   So 5Eh, 44h and the answer to 11h prove nothing; if both have the same serial number, a part that differs must be
///   asked.
/// - Two that answer differently at one instant destroy each other's frames: `absent`.
/// - CANopenNode in configuration answers any 43h with 44h, its own or not. So 44h alone does not show which device is
///   selected.
///
/// The window is the longest that the bus is known to need. The first proof on a master, and each after a doubt
/// (`Master::suspect_strangers`), asks all parts and waits `AloneOptions::longest`. Others wait three times the slowest
/// answer that the master received lately, at least 5 ms (`Master::answer_times`).
///
/// A device that lacks 5Ah to 5Dh cannot state its address. The master learns this once (`Master::lacks`): the device
/// answers `11 80`, which every slave in configuration refuses, before and after an inquiry that stays silent. From
/// then on it is selected so: `04 00`, `11 80` to which no device answers, 40h to 43h to which one does. The questions
/// of `still_alone` between 11h and `04 00` then have no answer: a doubt there is `not_alone`.
///
/// A device that lacks 40h to 43h is selected by Fastscan, which works for devices without a node-ID, if Fastscan has
/// brought it into configuration once (`prove_alone`).
///
/// The proof cannot detect:
/// - a device in configuration that receives nothing during the questions, and receives again before 11h
/// - with questions in a row, a device with the same serial number that forgets a question when the next comes too
///   early, and whose other answers all merge with the selected one's frames
///
/// Its answer to 11h, or any other frame on 7E4h, then comes beside the selected one's: `suspicious(reply)`. Call
/// `still_alone` then, before 17h and the last `04 00`. If the device is not alone, `11 FF` to all in configuration
/// takes the node-ID back before it is in use. `configure_alone` does so.
#pragma once

#include <optional>
#include <span>

#include "berth/lss/master.hpp"
#include "berth/lss/vacancy.hpp"

namespace berth::lss {

enum class Selection : std::uint8_t {
  alone,      ///< it is in configuration, and no other device is
  absent,     ///< it does not answer
  not_alone,  ///< another device is in configuration, or answers in its place
  clones,     ///< its own address is answered twice, repeatedly: two devices have it
};
[[nodiscard]] const char* name(Selection selection) noexcept;

/// Parts of an address, as bits: bit 0 vendor-ID to bit 3 serial number.
using PartMask = std::uint8_t;
inline constexpr PartMask serial_part = 0x8;
inline constexpr PartMask all_parts = 0xF;
/// The parts to ask to distinguish `device` from each of `others`: the serial number, and for each with the same serial
/// number one part that differs. `others` should contain every device that has been seen on the bus, or may come; a
/// missing one with the same serial number goes unnoticed. `all_parts` misses none.
[[nodiscard]] PartMask parts_to_ask(const LssAddress& device, std::span<const LssAddress> others) noexcept;

struct AloneOptions {
  PartMask parts = all_parts;  ///< the serial number is always asked
  rt::Duration longest{0};     ///< longest window of a question; 0: `MasterOptions::service`'s time-out
  unsigned attempts = 2;       ///< of 40h to 43h, each after a `04 00`
  /// The device may well be missing: one attempt, and 44h is waited for only as long as answers usually take.
  bool guess = false;
  /// Of several devices with this address, select only one without a node-ID that supports Fastscan: Fastscan selects
  /// it, because no device with a node-ID answers that (CiA 305 §Fastscan), while all answer 40h to 43h.
  bool without_node_id = false;
  /// The caller asks 5Eh at once and listens for as long as `window_of` returned before the proof. Late answers to the
  /// last question of a row come in that time, too (`suspicious`).
  bool followed = false;
  const Vacancy* vacancy = nullptr;  ///< `configure_alone` checks it before the node-ID comes into use; null: no check
};

/// How long after a request another device in configuration may still answer.
[[nodiscard]] rt::Duration window_of(const Master& master, const AloneOptions& options = {}) noexcept;

/// `04 00`, 40h to 43h, and the proof. If the result is not `alone`, `04 00` was sent and no device was changed.
/// Errors: `bus`, `cancelled`.
[[nodiscard]] rt::Task<Result<Selection>> select_alone(Master& master, LssAddress device, AloneOptions options = {});
/// Uses Fastscan to check whether a device with this address has no node-ID. All devices are waiting afterwards.
/// Errors: `bus`, `cancelled`.
[[nodiscard]] rt::Task<Result<bool>> any_without_node_id(Master& master, LssAddress device);
/// The proof for a device that is already in configuration. Results and errors as above.
[[nodiscard]] rt::Task<Result<Selection>> prove_alone(Master& master, LssAddress device, AloneOptions options = {});
/// The questions alone, without `04 00` whatever the result. For use between 11h and `04 00`, which would bring the
/// node-ID into use. `not_alone` if the device lacks 5Ah to 5Dh.
[[nodiscard]] rt::Task<Result<Selection>> still_alone(Master& master, LssAddress device, AloneOptions options = {});

/// The node-ID (5Eh) of the device that was proven alone. Empty: it lacks the service; `Master::lacks` then remembers
/// it. Errors: `timeout` it does not answer any more; `bus`, `cancelled`.
[[nodiscard]] rt::Task<Result<std::optional<Reply>>> ask_node_id(Master& master, LssAddress device,
                                                                 ServiceOptions service);

/// The result of configuring a node-ID on a device that is alone in configuration.
struct Given {
  enum class Outcome : std::uint8_t {
    taken,      ///< it answered 11h with success
    refused,    ///< it answered 11h with an error code
    silent,     ///< it did not answer
    not_alone,  ///< another device answered too: taken back from all
    occupied,   ///< another device was heard with the node-ID meanwhile: taken back
  };
  Outcome outcome = Outcome::silent;
  bool stored = false;  ///< 17h was answered with success
};
/// 11h, 17h if `store`, `04 00`, for a device that was just proven alone. Proves once more before 17h, and if the
/// answer to 11h is suspicious or came only after a repetition. In all outcomes except `taken` the pending node-ID is
/// 255 again (`11 FF`) before the `04 00`. Errors: `bus`, `cancelled`.
[[nodiscard]] rt::Task<Result<Given>> configure_alone(Master& master, LssAddress device, NodeId id, bool store,
                                                      AloneOptions options = {});
/// True if another device seems to have answered too.
[[nodiscard]] bool suspicious(const Reply& reply) noexcept;

}  // namespace berth::lss
