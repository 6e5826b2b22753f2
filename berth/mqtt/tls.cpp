#include "berth/mqtt/tls.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "berth/base/read_files.hpp"

namespace berth::mqtt {
namespace {

using Done = tl::expected<void, std::string>;

tl::unexpected<std::string> refuse(const std::string& file, const char* why) {
  return tl::unexpected(fmt::format("{}: {}", file, why));
}

/// Of a file that must be there: what is wrong, in words.
tl::expected<struct stat, std::string> look_at(const std::string& file) {
  note_read(file);
  struct stat what {};
  if (::stat(file.c_str(), &what) != 0) return tl::unexpected(fmt::format("{}: {}", file, std::strerror(errno)));
  if (!S_ISREG(what.st_mode)) return refuse(file, "this is not a file");
  return what;
}

int no_passphrase(char*, int, int, void* asked) {
  *static_cast<bool*>(asked) = true;
  return -1;
}

TlsNews* news_of(const SSL* ssl) noexcept { return static_cast<TlsNews*>(SSL_get_app_data(ssl)); }

void informed(const SSL* ssl, int where, int value) {
  TlsNews* const news = news_of(ssl);
  if (news == nullptr || (where & SSL_CB_READ_ALERT) != SSL_CB_READ_ALERT) return;
  const int alert = value & 0xFF;
  if (alert != SSL_AD_CLOSE_NOTIFY) news->alert = alert;
}

int verify(X509_STORE_CTX* chain, void*) {
  const int good = X509_verify_cert(chain);
  const auto* const ssl =
      static_cast<const SSL*>(X509_STORE_CTX_get_ex_data(chain, SSL_get_ex_data_X509_STORE_CTX_idx()));
  TlsNews* const news = ssl != nullptr ? news_of(ssl) : nullptr;
  if (news != nullptr && good != 1) {
    const int error = X509_STORE_CTX_get_error(chain);
    news->verification = error != X509_V_OK ? error : X509_V_ERR_UNSPECIFIED;
  }
  return good;
}

}  // namespace

Tls::Tls(std::string host) : context_(SSL_CTX_new(TLS_client_method())), host_(std::move(host)) {
  if (context_ == nullptr) return;
  SSL_CTX_set_min_proto_version(context_, TLS1_2_VERSION);
  SSL_CTX_set_options(context_, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_cipher_list(context_, "ECDHE+AESGCM:ECDHE+CHACHA20");  // of TLS 1.2; those of 1.3 are all good
  SSL_CTX_set_session_cache_mode(context_, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_mode(context_,
                   SSL_MODE_RELEASE_BUFFERS | SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  SSL_CTX_set_verify(context_, SSL_VERIFY_PEER, nullptr);
  SSL_CTX_set_cert_verify_callback(context_, verify, nullptr);
  SSL_CTX_set_info_callback(context_, informed);
}

Tls::~Tls() { SSL_CTX_free(context_); }

bool Tls::expect_host() {
  X509_VERIFY_PARAM* const wanted = SSL_CTX_get0_param(context_);
  X509_VERIFY_PARAM_set_hostflags(wanted, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
  if (is_address(host_)) return X509_VERIFY_PARAM_set1_ip_asc(wanted, host_.c_str()) == 1;
  return X509_VERIFY_PARAM_set1_host(wanted, host_.data(), host_.size()) == 1;
}

Done Tls::trust(const std::string& authorities) {
  if (authorities.empty()) {
    if (SSL_CTX_set_default_verify_paths(context_) == 1) return {};
    return tl::unexpected(std::string("the CA certificates of this computer cannot be read"));
  }
  if (const auto there = look_at(authorities); !there) return tl::unexpected(there.error());
  if (SSL_CTX_load_verify_file(context_, authorities.c_str()) == 1) return {};
  return refuse(authorities, "give certificates of CAs in PEM (-----BEGIN CERTIFICATE-----)");
}

Done Tls::show(const std::string& certificate, const std::string& key) {
  if (certificate.empty()) return {};
  if (const auto there = look_at(certificate); !there) return tl::unexpected(there.error());
  const auto of_key = look_at(key);
  if (!of_key) return tl::unexpected(of_key.error());
  if ((of_key->st_mode & 007U) != 0)
    return tl::unexpected(fmt::format("{}: every user of this computer can read this key: chmod 600 {}", key, key));
  bool asked = false;
  SSL_CTX_set_default_passwd_cb(context_, no_passphrase);
  SSL_CTX_set_default_passwd_cb_userdata(context_, &asked);
  if (SSL_CTX_use_certificate_chain_file(context_, certificate.c_str()) != 1)
    return refuse(certificate, "give a certificate in PEM (-----BEGIN CERTIFICATE-----)");
  const bool used = SSL_CTX_use_PrivateKey_file(context_, key.c_str(), SSL_FILETYPE_PEM) == 1;
  const auto reason = ERR_GET_REASON(ERR_peek_last_error());
  SSL_CTX_set_default_passwd_cb_userdata(context_, nullptr);
  SSL_CTX_set_default_passwd_cb(context_, nullptr);
  if (!used && asked)
    return tl::unexpected(
        fmt::format("{}: this key has a passphrase; remove it: openssl pkey -in {} -out FILE", key, key));
  if ((!used && reason == X509_R_KEY_VALUES_MISMATCH) || (used && SSL_CTX_check_private_key(context_) != 1))
    return tl::unexpected(fmt::format("{}: this is the key of another certificate than {}", key, certificate));
  if (!used) return refuse(key, "give a private key in PEM (-----BEGIN PRIVATE KEY-----)");
  return {};
}

tl::expected<std::shared_ptr<Tls>, std::string> Tls::load(const TlsFiles& files, const std::string& host) {
  std::shared_ptr<Tls> made(new Tls(host));
  if (made->context_ == nullptr || !made->expect_host())
    return tl::unexpected(std::string("TLS cannot be set up on this computer"));
  auto done = made->trust(files.authorities);
  if (done) done = made->show(files.certificate, files.key);
  ERR_clear_error();
  if (!done) return tl::unexpected(done.error());
  return made;
}

// The name is asked for (SNI, RFC 6066 §3), as a broker of many names has a certificate for each.
ssl_st* Tls::begin(int fd, TlsNews& news) const noexcept {
  SSL* const ssl = SSL_new(context_);
  if (ssl == nullptr) return nullptr;
  SSL_set_app_data(ssl, &news);
  std::string name = host_;
  if (!is_address(host_)) SSL_ctrl(ssl, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, name.data());
  if (SSL_set_fd(ssl, fd) == 1) return ssl;
  SSL_free(ssl);
  return nullptr;
}

}  // namespace berth::mqtt
