/// One device in LSS configuration, and the proof that it is the only one: what every path shares that gives a device
/// something by LSS. Slots are given their node-IDs by `places::Binder`, loans and what a search finds by
/// `configure_alone`. Without a proof go: what is meant for all in configuration (a new bit rate, `11 FF`), the
/// procedures of papers and standards as published (`discovery = "fastscan"`), and single services that a person or a
/// client of CiA 309 asks for by name.
///
///     auto alone = co_await lss::select_alone(master, device, options);
///     if (!alone) co_return fail(alone.error());            // the bus
///     if (*alone != lss::Selection::alone) co_return ...;   // all devices are waiting again, unchanged
///     auto given = co_await lss::configure_alone(master, device, id, store, options);  // 11h, 17h, 04 00
///
/// or 11h, 13h, 17h of your own, and `04 00` after them whatever came of it.
///
/// Equal devices without a serial number have one address. Those that have a node-ID stay in LSS waiting when the one
/// without is selected by Fastscan (`AloneOptions::without_node_id`); several without one are `clones`, when they do
/// not answer at one instant.
///
/// `select_alone` sends `04 00`, because CiA 305 serves 40h to 43h in LSS waiting only (docs/protocols/cia305.md §State
/// table), then 40h to 43h, and proves. Each further attempt begins with `04 00` too: the device may be in
/// configuration and its 44h lost. `prove_alone` proves only, for a device that Fastscan's last match brought there.
/// Fastscan's match may be proven so at once: 5Dh is served in configuration. To use 40h to 43h on it, `select_alone`
/// sends the `04 00` that this needs.
///
/// Why a proof: `04 00` has no answer, and a device that lost it (its receive buffer was full, it was writing its
/// memory, it was selected unheard) is in configuration beside the one that is selected. Both execute 11h and take one
/// node-ID at the next `04 00`.
///
/// What is asked: the serial number (5Dh), and those parts of the address (5Ah to 5Ch) in which another device could
/// differ that has the same serial number. Every answer must be the device's own, and one.
/// - On a calm bus, where for four of the longest windows no service went unanswered, no device was lost, and no frame
///   came on 7E4h that no request had asked for, in a row: each question follows the answer to the one before, the
///   serial number last, and its whole window is that of all. Is anything heard but the one answer to each: one by one.
/// - Else one by one, the serial number first, each for a whole window: a device that is deaf while it stores hears
///   again meanwhile, and answers 17h. On a calm bus it was listened for before.
///
/// - Different answers, or one of another device: `not_alone`.
/// - Two equal answers are those of another device in configuration, or a frame that came twice; the part is asked
///   again. Three times so, and the other parts are told as they are the device's: `clones`; is one told otherwise, or
///   by none: `not_alone`. Else all is asked once more.
/// - A frame on 7E4h that no question asked for is that of a device which hears again and did not hear the questions
///   before: all is asked once more.
/// - Two devices that answer the same may fall into one frame on the wire (one identifier, one content, one instant).
///   So 5Eh proves nothing, nor 44h, nor the answer to 11h; a serial number that both have needs a part that differs.
/// - Two that answer differently at one instant destroy each other's frames: `absent`.
/// - CANopenNode in configuration answers any 43h with 44h, its own or not. So 44h alone does not tell which device
///   is selected.
///
/// The window: the longest the bus is known to need. The first proof on a master, and each after a doubt
/// (`Master::suspect_strangers`), asks all parts and waits `AloneOptions::longest`; others three times what the slowest
/// answer took that the master heard lately, not under 5 ms (`Master::answer_times`).
///
/// A device that lacks 5Ah to 5Dh cannot say so. That is learnt once (`Master::lacks`): it answers `11 80`, which every
/// slave in configuration refuses, before and after an inquiry that stays silent. From then on it is selected from
/// nobody: `04 00`, `11 80` to which no device answers, 40h to 43h to which one does. What `still_alone` asks between
/// 11h and `04 00` has no answer then: a doubt there is `not_alone`.
///
/// One that lacks 40h to 43h is selected by Fastscan, which is for devices without a node-ID: after it was brought into
/// configuration by that once (`prove_alone`).
///
/// What no proof sees: a device in configuration that hears nothing at all while the questions are asked, and hears
/// again before 11h; and, in a row, one of the same serial number that forgets a question when the next comes too early
/// for it, and whose other answers all fall into the selected one's frames. Its answer to 11h, or any other frame on
/// 7E4h, then comes beside the selected one's: `suspicious(reply)`. Ask `still_alone` then, before 17h and the last
/// `04 00`; when it is not, `11 FF` to all that are in configuration takes the node-ID back before it is in use.
/// `configure_alone` does so.
#pragma once

#include <optional>
#include <span>

#include "berth/lss/master.hpp"
#include "berth/lss/vacancy.hpp"

namespace berth::lss {

enum class Selection : std::uint8_t {
  alone,      ///< it is in configuration, and no other
  absent,     ///< it does not answer
  not_alone,  ///< another device is in configuration, or answers in its place
  clones,     ///< its own address is answered twice, again and again: two devices have it
};
[[nodiscard]] const char* name(Selection selection) noexcept;

/// Parts of an address, as bits: bit 0 vendor-ID to bit 3 serial number.
using PartMask = std::uint8_t;
inline constexpr PartMask serial_part = 0x8;
inline constexpr PartMask all_parts = 0xF;
/// The parts to ask so that `device` is told from each of `others`: the serial number, and for each that has the same
/// serial number one part in which it differs. A device that has been seen on the bus, or may come, belongs into
/// `others`; one that is not in there and has the same serial number goes unseen. `all_parts` misses none.
[[nodiscard]] PartMask parts_to_ask(const LssAddress& device, std::span<const LssAddress> others) noexcept;

struct AloneOptions {
  PartMask parts = all_parts;  ///< the serial number is always asked
  rt::Duration longest{0};     ///< longest window of a question; 0: `MasterOptions::service`'s time-out
  unsigned attempts = 2;       ///< of 40h to 43h, each after a `04 00`
  /// The device may well not be there: one attempt, and 44h is waited for as long as answers usually take.
  bool guess = false;
  /// Of several devices with this address only one that has no node-ID is meant, and it speaks Fastscan: it is selected
  /// by that, which no device with a node-ID answers (CiA 305 §Fastscan), instead of by 40h to 43h, which all do.
  bool without_node_id = false;
  /// The caller asks 5Eh at once and listens for as long as `window_of` told before the proof: what the last question
  /// of a row would be waited for comes then, too (`suspicious`).
  bool followed = false;
  const Vacancy* vacancy = nullptr;  ///< `configure_alone` asks it before the node-ID comes into use; null: no
};

/// So long after a request another device in configuration may answer it, too.
[[nodiscard]] rt::Duration window_of(const Master& master, const AloneOptions& options = {}) noexcept;

/// `04 00`, 40h to 43h, and the proof. All but `alone`: `04 00` was sent, no device was changed. Errors: `bus`,
/// `cancelled`.
[[nodiscard]] rt::Task<Result<Selection>> select_alone(Master& master, LssAddress device, AloneOptions options = {});
/// By Fastscan: a device of this address is there that has no node-ID. All are waiting again. Errors: `bus`,
/// `cancelled`.
[[nodiscard]] rt::Task<Result<bool>> any_without_node_id(Master& master, LssAddress device);
/// The proof for a device that is in configuration already. As above.
[[nodiscard]] rt::Task<Result<Selection>> prove_alone(Master& master, LssAddress device, AloneOptions options = {});
/// The questions alone: no `04 00`, whatever comes of it. For between 11h and `04 00`, which would bring the node-ID
/// into use. `not_alone` where the device lacks 5Ah to 5Dh.
[[nodiscard]] rt::Task<Result<Selection>> still_alone(Master& master, LssAddress device, AloneOptions options = {});

/// What the device that was proven alone says of its node-ID (5Eh). Empty: it lacks the service, as `Master::lacks`
/// has it from then on. Errors: `timeout` it does not answer any more; `bus`, `cancelled`.
[[nodiscard]] rt::Task<Result<std::optional<Reply>>> ask_node_id(Master& master, LssAddress device,
                                                                 ServiceOptions service);

/// What came of a node-ID for a device that is alone in configuration.
struct Given {
  enum class Outcome : std::uint8_t {
    taken,      ///< it answered 11h with success
    refused,    ///< it answered 11h with an error code
    silent,     ///< it did not answer
    not_alone,  ///< another device answered too: taken back from all
    occupied,   ///< another device was heard under the node-ID meanwhile: taken back
  };
  Outcome outcome = Outcome::silent;
  bool stored = false;  ///< 17h was answered with success
};
/// 11h, 17h when `store`, `04 00`, for a device that was just proven alone. Proves once more before 17h, and when the
/// answer to 11h is suspicious or came to a repetition only. In all outcomes but `taken` the pending node-ID is 255
/// again (`11 FF`) before the `04 00`. Errors: `bus`, `cancelled`.
[[nodiscard]] rt::Task<Result<Given>> configure_alone(Master& master, LssAddress device, NodeId id, bool store,
                                                      AloneOptions options = {});
/// Another device seems to have answered too.
[[nodiscard]] bool suspicious(const Reply& reply) noexcept;

}  // namespace berth::lss
