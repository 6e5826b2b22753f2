#include "berth/studio/tls.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace berth::studio {
namespace {

using Code = boost::system::error_code;

// OpenSSL's context owns the certificate.
X509* certificate_of(SSL_CTX* context) { return SSL_CTX_get0_certificate(context); }

std::string address_text(const ASN1_OCTET_STRING& address) {
  const unsigned char* const bytes = ASN1_STRING_get0_data(&address);
  if (ASN1_STRING_length(&address) == 4) return fmt::format("{}.{}.{}.{}", bytes[0], bytes[1], bytes[2], bytes[3]);
  if (ASN1_STRING_length(&address) != 16) return {};
  std::string text;
  for (int i = 0; i < 16; i += 2) text += fmt::format("{}{:x}", i == 0 ? "" : ":", bytes[i] << 8U | bytes[i + 1]);
  return text;
}

std::string name_text(const GENERAL_NAME& name) {
  if (name.type == GEN_IPADD) return address_text(*name.d.iPAddress);
  if (name.type != GEN_DNS) return {};
  const auto* const text = ASN1_STRING_get0_data(name.d.dNSName);
  return {text, text + ASN1_STRING_length(name.d.dNSName)};
}

std::string problem(const std::string& file, const Code& error) { return fmt::format("{}: {}", file, error.message()); }

/// Checks that the file exists. Errors: in words.
tl::expected<struct stat, std::string> look_at(const std::string& file) {
  struct stat what {};
  if (::stat(file.c_str(), &what) != 0) return tl::unexpected(fmt::format("{}: {}", file, std::strerror(errno)));
  if (!S_ISREG(what.st_mode)) return tl::unexpected(fmt::format("{}: this is not a file", file));
  return what;
}

}  // namespace

// Attacks on TLS rest on old versions, compression and renegotiation; a page needs none of them. Without a cache and
// tickets, a client that connects often leaves nothing in memory.
Tls::Tls() : context_(boost::asio::ssl::context::tls_server) {
  SSL_CTX_set_min_proto_version(native_, TLS1_2_VERSION);
  SSL_CTX_set_options(
      native_, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_NO_TICKET);
  SSL_CTX_set_session_cache_mode(native_, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_num_tickets(native_, 0);
  SSL_CTX_set_cipher_list(native_, "ECDHE+AESGCM:ECDHE+CHACHA20");  // for TLS 1.2; the ciphers of 1.3 are all good
}

tl::expected<std::unique_ptr<Tls>, std::string> Tls::load(const std::string& certificate, const std::string& key) {
  std::unique_ptr<Tls> made(new Tls);
  auto& context = made->context_;
  if (const auto there = look_at(certificate); !there) return tl::unexpected(there.error());
  const auto of_key = look_at(key);
  if (!of_key) return tl::unexpected(of_key.error());
  if ((of_key->st_mode & 007U) != 0)
    return tl::unexpected(fmt::format("{}: every user of this computer can read this key: chmod 600 {}", key, key));
  Code error;
  bool asked = false;
  context.set_password_callback(
      [&asked](std::size_t, boost::asio::ssl::context::password_purpose) {
        asked = true;
        return std::string();
      },
      error);
  context.use_certificate_chain_file(certificate, error);
  if (error)
    return tl::unexpected(problem(certificate, error) + ": give a certificate in PEM (-----BEGIN CERTIFICATE-----)");
  context.use_private_key_file(key, boost::asio::ssl::context::pem, error);
  if (error && asked)
    return tl::unexpected(
        fmt::format("{}: this key has a passphrase; remove it: openssl pkey -in {} -out FILE", key, key));
  if (error && ERR_GET_REASON(static_cast<unsigned long>(error.value())) == X509_R_KEY_VALUES_MISMATCH)
    return tl::unexpected(fmt::format("{}: this is the key of another certificate than {}", key, certificate));
  if (error) return tl::unexpected(problem(key, error) + ": give a private key in PEM (-----BEGIN PRIVATE KEY-----)");
  if (SSL_CTX_check_private_key(context.native_handle()) != 1)
    return tl::unexpected(fmt::format("{}: this is the key of another certificate than {}", key, certificate));
  context.set_password_callback([](std::size_t, boost::asio::ssl::context::password_purpose) { return std::string(); },
                                error);
  if (made->first_name().empty())
    return tl::unexpected(fmt::format(
        "{}: this certificate is for no name and no address (subjectAltName): browsers reject it", certificate));
  return made;
}

// OpenSSL takes a leading dot for all names beneath it.
bool Tls::names(const std::string& host) const {
  if (host.empty() || host.front() == '.') return false;
  X509* const certificate = certificate_of(native_);
  return X509_check_ip_asc(certificate, host.c_str(), 0) == 1 ||
         X509_check_host(certificate, host.data(), host.size(), X509_CHECK_FLAG_NEVER_CHECK_SUBJECT, nullptr) == 1;
}

std::string Tls::first_name() const {
  auto* const all =
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate_of(native_), NID_subject_alt_name, nullptr, nullptr));
  std::string found;
  for (int i = 0; all != nullptr && found.empty() && i < sk_GENERAL_NAME_num(all); ++i) {
    auto text = name_text(*sk_GENERAL_NAME_value(all, i));
    if (text.starts_with("*.")) text = "studio" + text.substr(1);
    found = std::move(text);
  }
  GENERAL_NAMES_free(all);
  return found;
}

std::string needs_certificate(const io::Endpoint& where) {
  const bool any = where.host == "0.0.0.0" || where.host == "::";
  const bool address =
      where.host.find_first_not_of("0123456789.") == std::string::npos || where.host.find(':') != std::string::npos;
  const auto name = any ? std::string("DNS:$(hostname)") : fmt::format("{}:{}", address ? "IP" : "DNS", where.host);
  return fmt::format(
      "{}: other computers may reach this address, and without encryption (TLS) anybody on the way can read the token. "
      "Give Studio a certificate: --studio-certificate FILE --studio-key FILE (berth studio: --certificate, --key). "
      "To make one: openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 365 -subj "
      "/CN=berth -addext subjectAltName={} -keyout studio.key -out studio.crt. Or stay on this computer and use an ssh "
      "tunnel with the same port at both ends: ssh -L {}:127.0.0.1:{} HOST",
      io::to_string(where), name, where.port, where.port);
}

}  // namespace berth::studio
