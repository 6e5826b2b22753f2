/// Why there is no connection, or none any more: a kind for programs, and words for people, which say what happened and
/// what to do. Pure.
#pragma once

#include <cstdint>
#include <string>

namespace berth::mqtt {

enum class Why : std::uint8_t {
  ended,                  ///< by this client, as it was asked to
  name_not_found,         ///< the host's name
  refused,                ///< nothing listens at this port
  unreachable,            ///< no way to the host
  no_answer,              ///< the host or the broker was silent for too long
  certificate_expired,    ///< the broker's
  certificate_early,      ///< the broker's is not valid yet
  certificate_untrusted,  ///< the broker's: no CA that is trusted has signed it
  certificate_name,       ///< the broker's is for another name
  certificate,            ///< the broker's is wrong otherwise
  own_certificate,        ///< the broker wants one from this client, or rejects it
  tls,                    ///< no TLS with this peer
  version_refused,        ///< the broker does not speak this version of MQTT
  client_id_refused,
  bad_login,         ///< user or password
  not_authorised,    ///< the user may not do this
  unavailable,       ///< the broker is busy, or not ready
  shutting_down,     ///< the broker
  taken_over,        ///< another client came with the same client-ID
  packet_too_large,  ///< for the broker, or from it
  keep_alive,        ///< the connection was silent for too long
  closed,            ///< by the broker, without a reason
  protocol,          ///< what came is not MQTT, or breaks its rules
  refused_otherwise,
  own_computer,  ///< out of descriptors or memory, a file that cannot be read
};

/// The word of a kind, for JSON and metrics: "name-not-found".
[[nodiscard]] const char* name(Why why) noexcept;

struct Cause {
  Why why = Why::closed;
  std::string words{};
};

/// A reason code of MQTT 5 in CONNACK, SUBACK, PUBACK or DISCONNECT (§2.4).
[[nodiscard]] Cause of_reason_code(unsigned code);
/// A return code of MQTT 3.1.1's CONNACK (§3.2.2.3).
[[nodiscard]] Cause of_return_code(unsigned code);
/// The connection was closed or reset, and nothing was said, as by MQTT 3.1.1 always, and by Mosquitto 2.0 also by 5.
/// `answered`: the broker had accepted it.
[[nodiscard]] Cause of_close(bool answered);
/// An errno of a socket.
[[nodiscard]] Cause of_system_error(int error);
/// An error of getaddrinfo.
[[nodiscard]] Cause of_lookup(const std::string& host, int error);
/// A result of a certificate's verification (X509_V_ERR_...), of the broker for `host`.
[[nodiscard]] Cause of_verification(const std::string& host, long result);
/// An alert that the broker sent (RFC 8446 §6).
[[nodiscard]] Cause of_alert(int alert);
/// A failure of TLS that is neither; `detail` is OpenSSL's line about it.
[[nodiscard]] Cause of_tls(const std::string& detail);

}  // namespace berth::mqtt
