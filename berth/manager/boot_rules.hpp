/// What a master stores for the boot-up of its network (CiA 302-2; docs/protocols/cia302.md §Objects of a master): the
/// NMT startup (1F80h), and for each slave its assignment (1F81h) and its expected identity and versions. The objects'
/// values in decoded form, from an object dictionary or a machine file: the procedures do not distinguish the two.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/rt/executor.hpp"

namespace berth::manager {

/// 1F80h.
struct Startup {
  bool master = false;                ///< bit 0
  bool starts_all_at_once = false;    ///< bit 1: one NMT start for all, when the mandatory slaves are ready
  bool application_operates = false;  ///< bit 2: the application makes the master operational
  bool application_starts = false;    ///< bit 3: the application starts the slaves
  bool resets_all_on_error = false;   ///< bit 4: an error of a mandatory slave resets all nodes
  bool flying = false;                ///< bit 5: takes part in the flying master procedure
  bool stops_all_on_error = false;    ///< bit 6: an error of a mandatory slave stops all nodes; bit 4 is then ignored

  friend bool operator==(const Startup&, const Startup&) = default;
};
/// Errc::invalid: a reserved bit (7 to 31) is set; the answer to such a download is 0609 0030h.
[[nodiscard]] Result<Startup> startup_of(std::uint32_t object_1f80) noexcept;
[[nodiscard]] std::uint32_t value_of(const Startup& startup) noexcept;

/// How 1F87h is compared. Public sources differ (docs/protocols/cia302.md, **Open**).
enum class RevisionCheck : std::uint8_t {
  equal,
  compatible,  ///< the major part (bits 31 to 16) equal, the minor part at least the expected one
};

/// The expected versions of a slave, beside its identity. A number of 0 and an empty text are not checked. With
/// `SlaveRules::checks_software` one software value is compared: the identification if given, else date and time (CiA's
/// DSP 302 version 3, as in paper 5), else the text.
struct ExpectedVersions {
  std::uint32_t software = 0;       ///< 1F55h, against the slave's 1F56h:01
  std::uint32_t software_date = 0;  ///< 1F53h, days since 1984-01-01, against 1F52h:01
  std::uint32_t software_time = 0;  ///< 1F54h, ms after midnight, against 1F52h:02
  std::string software_text = {};   ///< against 100Ah; not in an object, only in a machine file
  std::string hardware_text = {};   ///< against 1009h; only in a machine file
  std::uint32_t hardware = 0;       ///< 5F02h, against the slave's 5F01h (paper 3's numeric hardware version)
};

/// One slave: 1F81h, 1F84h to 1F88h, 1F8Ah, 1F26h and 1F27h, 1F53h to 1F55h, 1016h. A number of 0 is not checked, as in
/// CiA 302.
struct SlaveRules {
  bool assigned = false;          ///< bit 0; without it the other bits are ignored
  bool boots = false;             ///< bit 2: booted on a boot-up message and on an error event; else only error control
  bool mandatory = false;         ///< bit 3: the network is not started without it
  bool keep_alive = false;        ///< bit 4: not reset while it is operational
  bool checks_software = false;   ///< bit 5
  bool may_update = false;        ///< bit 6; not with `keep_alive`
  bool restores = false;          ///< bit 7: factory settings before its configuration
  std::uint8_t retry_factor = 0;  ///< bits 15 to 8, of node guarding
  rt::Duration guard_time{};      ///< bits 31 to 16, ms; 0: no node guarding

  std::uint32_t device_type = 0;  ///< 1F84h
  std::uint32_t vendor = 0;       ///< 1F85h
  std::uint32_t product = 0;      ///< 1F86h
  std::uint32_t revision = 0;     ///< 1F87h
  std::uint32_t serial = 0;       ///< 1F88h
  RevisionCheck revision_check = RevisionCheck::equal;

  std::uint8_t restore_sub = 0;     ///< 1F8Ah: sub-index of the slave's 1011h; 0: none
  std::uint32_t expected_date = 0;  ///< 1F26h
  std::uint32_t expected_time = 0;  ///< 1F27h
  ExpectedVersions expected = {};
  rt::Duration heartbeat{};  ///< the consumer time of its entry in 1016h; 0: none
};
/// Decodes the bits of 1F81h; the other rules keep their defaults.
[[nodiscard]] SlaveRules slave_rules_of(std::uint32_t object_1f81) noexcept;
[[nodiscard]] std::uint32_t value_of(const SlaveRules& rules) noexcept;

/// How the boot-up of one slave ended: the error status letters of CiA 302-2.
enum class BootStatus : std::uint8_t {
  booted = 0,  ///< no letter
  a = 'A',     ///< not in the network list (1F81h)
  b = 'B',     ///< no answer to the upload of 1000h
  c = 'C',     ///< device type differs from 1F84h
  d = 'D',     ///< vendor-ID differs from 1F85h
  e = 'E',     ///< no heartbeat when its state was checked
  f = 'F',     ///< no answer to node guarding when its state was checked
  g = 'G',     ///< no expected software (1F55h), or the slave reports none
  h = 'H',     ///< different software, and it may not be updated
  i = 'I',     ///< different software, and the update failed
  j = 'J',     ///< the configuration failed
  k = 'K',     ///< no heartbeat when error control was started
  l = 'L',     ///< not an error: it was already operational
  m = 'M',     ///< product code differs from 1F86h
  n = 'N',     ///< revision number differs from 1F87h
  o = 'O',     ///< serial number differs from 1F88h
};
/// 'A' to 'O'; 0 for `booted`.
[[nodiscard]] constexpr char letter(BootStatus status) noexcept { return static_cast<char>(status); }
/// "no answer to the upload of 1000h".
[[nodiscard]] std::string_view text(BootStatus status) noexcept;
/// What a user can do about it: one sentence.
[[nodiscard]] std::string_view advice(BootStatus status) noexcept;
/// The slave is ready: the network may be started with it.
[[nodiscard]] constexpr bool is_ready(BootStatus status) noexcept {
  return status == BootStatus::booted || status == BootStatus::l;
}

}  // namespace berth::manager
