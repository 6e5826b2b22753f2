#include "berth/mqtt/cause.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <openssl/ssl.h>
#include <openssl/x509_vfy.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>

namespace berth::mqtt {
namespace {

struct Row {
  unsigned code;
  Why why;
  const char* words;
};

// MQTT 5.0 table 2-6; what a client of QoS 0 and 1 can meet.
constexpr Row reason_codes[] = {
    {128, Why::refused_otherwise, "the broker reports an error without a reason"},
    {129, Why::protocol, "the broker could not read a packet of this client"},
    {130, Why::protocol, "the broker reports an error in the protocol"},
    {131, Why::refused_otherwise, "the broker does not do what was asked; its log says why"},
    {132, Why::version_refused, "the broker does not speak this version of MQTT"},
    {133, Why::client_id_refused, "the broker does not accept this client-ID: choose another"},
    {134, Why::bad_login, "the user or the password is wrong"},
    {135, Why::not_authorised, "the broker does not allow this: give the user or the client-ID the right to it"},
    {136, Why::unavailable, "the broker is not ready: look whether it has started"},
    {137, Why::unavailable, "the broker is busy"},
    {138, Why::not_authorised, "the broker has banned this client: ask whoever runs the broker"},
    {139, Why::shutting_down, "the broker is shutting down"},
    {140, Why::bad_login, "the broker wants another way of authentication than user and password"},
    {141, Why::keep_alive, "the broker heard nothing from this client within the keep-alive time"},
    {142, Why::taken_over,
     "another client connected with the same client-ID: look for a second machine or program that uses it"},
    {143, Why::refused_otherwise, "the broker does not accept the topic filter"},
    {144, Why::refused_otherwise, "the broker does not accept the topic"},
    {147, Why::protocol, "the broker has more messages to acknowledge than it allows"},
    {149, Why::packet_too_large,
     "a packet was larger than the broker allows: raise its limit, or publish less at once"},
    {150, Why::refused_otherwise, "the broker limits the rate of messages, and it was exceeded"},
    {151, Why::refused_otherwise, "a quota of the broker is used up"},
    {152, Why::refused_otherwise, "the broker ended the connection by an administrator's act"},
    {153, Why::refused_otherwise, "the broker does not accept the payload's format"},
    {154, Why::refused_otherwise, "the broker keeps no retained messages: allow them there"},
    {155, Why::refused_otherwise, "the broker does not offer QoS 1: allow it there"},
    {156, Why::refused_otherwise, "the broker wants this client to use another server: name that one"},
    {157, Why::refused_otherwise, "the broker has moved to another server: name that one"},
    {158, Why::refused_otherwise, "the broker has no shared subscriptions"},
    {159, Why::unavailable, "the broker limits the rate of connections, and it was exceeded"},
    {160, Why::refused_otherwise, "the broker ended the connection because it had lasted as long as it allows"},
    {161, Why::refused_otherwise, "the broker has no subscription identifiers"},
    {162, Why::refused_otherwise, "the broker has no subscriptions with wildcards: allow them there"},
};

constexpr Row return_codes[] = {
    {1, Why::version_refused, "the broker does not speak this version of MQTT"},
    {2, Why::client_id_refused, "the broker does not accept this client-ID: choose another"},
    {3, Why::unavailable, "the broker is not ready: look whether it has started"},
    {4, Why::bad_login, "the user or the password is wrong"},
    {5, Why::not_authorised, "the broker does not let this client in: look at the user, the password and its rights"},
};

constexpr Row alerts[] = {
    {SSL_AD_BAD_CERTIFICATE, Why::own_certificate, "the broker rejects this client's certificate"},
    {SSL_AD_UNSUPPORTED_CERTIFICATE, Why::own_certificate, "the broker rejects this kind of client certificate"},
    {SSL_AD_CERTIFICATE_REVOKED, Why::own_certificate, "this client's certificate was revoked: get a new one"},
    {SSL_AD_CERTIFICATE_EXPIRED, Why::own_certificate, "this client's certificate has expired: get a new one"},
    {SSL_AD_CERTIFICATE_UNKNOWN, Why::own_certificate, "the broker rejects this client's certificate"},
    {SSL_AD_UNKNOWN_CA, Why::own_certificate,
     "the broker does not trust the CA of this client's certificate: add that CA at the broker"},
    {SSL_AD_ACCESS_DENIED, Why::own_certificate, "the broker does not let the owner of this certificate in"},
    {SSL_AD_PROTOCOL_VERSION, Why::tls, "the broker speaks neither TLS 1.2 nor 1.3"},
    {SSL_AD_HANDSHAKE_FAILURE, Why::tls,
     "the broker and this client have no kind of encryption in common, or it wants a certificate from this client"},
    {SSL_AD_UNRECOGNIZED_NAME, Why::certificate_name, "the broker has no certificate for the name it was called by"},
    {SSL_AD_CERTIFICATE_REQUIRED, Why::own_certificate, "the broker wants a certificate from this client"},
};

const Row* find(std::span<const Row> rows, unsigned code) noexcept {
  const auto it = std::ranges::find(rows, code, &Row::code);
  return it == rows.end() ? nullptr : &*it;
}

constexpr std::array<const char*, 25> names{
    "ended",
    "name-not-found",
    "refused",
    "unreachable",
    "no-answer",
    "certificate-expired",
    "certificate-early",
    "certificate-untrusted",
    "certificate-name",
    "certificate",
    "own-certificate",
    "tls",
    "version-refused",
    "client-id-refused",
    "bad-login",
    "not-authorised",
    "unavailable",
    "shutting-down",
    "taken-over",
    "packet-too-large",
    "keep-alive",
    "closed",
    "protocol",
    "refused-otherwise",
    "own-computer",
};
static_assert(names.size() == static_cast<std::size_t>(Why::own_computer) + 1);

}  // namespace

const char* name(Why why) noexcept { return names[static_cast<std::size_t>(why)]; }

Cause of_reason_code(unsigned code) {
  if (const auto* const row = find(reason_codes, code)) return {row->why, row->words};
  return {Why::refused_otherwise, fmt::format("the broker gives the reason code {}", code)};
}

Cause of_return_code(unsigned code) {
  if (const auto* const row = find(return_codes, code)) return {row->why, row->words};
  return {Why::refused_otherwise, fmt::format("the broker gives the return code {}", code)};
}

Cause of_close(bool answered) {
  if (answered)
    return {Why::closed,
            "the broker closed the connection without a reason: look whether it still runs, and whether another client "
            "uses the same client-ID"};
  return {Why::closed,
          "the broker closed the connection before it answered: look at its log, and whether this is its port for TLS "
          "(mqtts://)"};
}

Cause of_system_error(int error) {
  switch (error) {
    case ECONNREFUSED:
      return {Why::refused, "nothing listens at this port: look whether the broker runs, and at its port"};
    case EHOSTUNREACH:
    case ENETUNREACH:
    case EHOSTDOWN:
    case ENETDOWN:
    case EADDRNOTAVAIL:
      return {Why::unreachable, fmt::format("there is no way to this host ({}): look at the network and its routes",
                                            std::strerror(error))};
    case ETIMEDOUT: return {Why::no_answer, "the host does not answer: look whether it runs, and at firewalls"};
    case ECONNRESET:
    case EPIPE:
    case 0: return {Why::closed, "the broker closed the connection"};
    case EMFILE:
    case ENFILE:
    case ENOMEM:
    case ENOBUFS:
      return {Why::own_computer, fmt::format("this computer has no room for a connection: {}", std::strerror(error))};
    default: return {Why::closed, fmt::format("the connection broke: {}", std::strerror(error))};
  }
}

Cause of_lookup(const std::string& host, int error) {
  switch (error) {
    case EAI_NONAME:
    case EAI_NODATA:
      return {Why::name_not_found,
              fmt::format("there is no host {}: look at the name, and at the name server of this computer", host)};
    case EAI_AGAIN:
      return {Why::name_not_found, fmt::format("the name server gives no answer about {}: look at the network", host)};
    default: return {Why::name_not_found, fmt::format("{} could not be looked up: {}", host, ::gai_strerror(error))};
  }
}

Cause of_verification(const std::string& host, long result) {
  switch (result) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return {Why::certificate_expired,
              "the broker's certificate, or one of its CAs', has expired: renew it at the broker, or set the clock of "
              "this computer"};
    case X509_V_ERR_CERT_NOT_YET_VALID:
      return {Why::certificate_early,
              "the broker's certificate is not valid yet: set the clock of this computer, or wait"};
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
      return {Why::certificate_name,
              fmt::format("the broker's certificate is not for {}: call the broker by the name in its certificate, or "
                          "get one for this name",
                          host)};
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
    case X509_V_ERR_CERT_UNTRUSTED:
      return {Why::certificate_untrusted,
              "no CA that this computer trusts has signed the broker's certificate: name the file of its CA"};
    default:
      return {Why::certificate,
              fmt::format("the broker's certificate is wrong: {}", ::X509_verify_cert_error_string(result))};
  }
}

Cause of_alert(int alert) {
  if (const auto* const row = find(alerts, static_cast<unsigned>(alert))) return {row->why, row->words};
  return {Why::tls, fmt::format("the broker ended TLS with the alert {}", alert)};
}

Cause of_tls(const std::string& detail) {
  if (detail.find("wrong version number") != std::string::npos)
    return {Why::tls, "the peer does not speak TLS at this port: use the port for TLS, or mqtt:// without TLS"};
  if (detail.find("unexpected eof") != std::string::npos || detail.empty())
    return {Why::tls, "the peer closed the connection while TLS began: look whether this is the broker's port for TLS"};
  return {Why::tls, fmt::format("TLS failed: {}", detail)};
}

}  // namespace berth::mqtt
