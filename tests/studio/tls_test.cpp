// Which certificates and keys are taken, and which names they are for. The files are made here, by OpenSSL.
#include "berth/studio/tls.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <string>

#include "../pch.hpp"

namespace berth::studio {
namespace {

class StudioTls : public ::testing::Test {
 protected:
  ~StudioTls() override {
    for (const auto& file : made_) ::unlink(file.c_str());
  }
  std::string file(const std::string& name) {
    made_.push_back(fmt::format("{}/tls_{}_{}", ::testing::TempDir(), ::getpid(), name));
    return made_.back();
  }
  std::string text_file(const std::string& name, const std::string& text) {
    const auto path = file(name);
    std::ofstream(path) << text;
    ::chmod(path.c_str(), 0600);
    return path;
  }
  /// A key of mode 0600, and a certificate for these names of it.
  std::string key_file(EVP_PKEY* key, const std::string& name, const char* passphrase = nullptr) {
    const auto path = file(name);
    std::FILE* const out = std::fopen(path.c_str(), "w");
    EXPECT_EQ(PEM_write_PKCS8PrivateKey(out, key, passphrase != nullptr ? EVP_aes_128_cbc() : nullptr, passphrase,
                                        passphrase != nullptr ? 4 : 0, nullptr, nullptr),
              1);
    std::fclose(out);
    ::chmod(path.c_str(), 0600);
    return path;
  }
  std::string certificate_file(EVP_PKEY* key, const std::string& name, const std::string& names) {
    const std::unique_ptr<X509, decltype(&X509_free)> certificate(X509_new(), &X509_free);
    X509_set_version(certificate.get(), 2);
    ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), 1);
    X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -60);
    X509_gmtime_adj(X509_getm_notAfter(certificate.get()), 3600);
    X509_set_pubkey(certificate.get(), key);
    if (!names.empty()) {
      X509_EXTENSION* const extension = X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, names.c_str());
      X509_add_ext(certificate.get(), extension, -1);
      X509_EXTENSION_free(extension);
    }
    EXPECT_GT(X509_sign(certificate.get(), key, EVP_sha256()), 0);
    const auto path = file(name);
    std::FILE* const out = std::fopen(path.c_str(), "w");
    EXPECT_EQ(PEM_write_X509(out, certificate.get()), 1);
    std::fclose(out);
    return path;
  }
  static std::string refusal(const std::string& certificate, const std::string& key) {
    const auto tls = Tls::load(certificate, key);
    return tls ? std::string("taken") : tls.error();
  }
  using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
  Key key_{EVP_EC_gen("P-256"), &EVP_PKEY_free};
  std::vector<std::string> made_;
};

bool says(const std::string& words, const std::string& file, const std::string& reason) {
  return words.starts_with(file + ": ") && words.find(reason) != std::string::npos;
}

}  // namespace

TEST_F(StudioTls, ANameIsTheCertificatesOrItIsNot) {
  const auto certificate =
      certificate_file(key_.get(), "crt", "DNS:plant.example,DNS:*.hall.example,IP:10.0.0.5,IP:fd00::7");
  const auto tls = Tls::load(certificate, key_file(key_.get(), "key"));
  ASSERT_TRUE(tls) << tls.error();
  for (const char* good : {"plant.example", "PLANT.example", "a.hall.example", "10.0.0.5", "fd00::7"})
    EXPECT_TRUE((*tls)->names(good)) << good;
  for (const char* bad : {"", "evil.example", "x.plant.example", ".plant.example", ".example", "a.b.hall.example",
                          "10.0.0.6", "plant.example.", "berth"})
    EXPECT_FALSE((*tls)->names(bad)) << bad;
  EXPECT_FALSE((*tls)->names(std::string("plant.example\0.evil", 19)));
  EXPECT_EQ((*tls)->first_name(), "plant.example");
}

TEST_F(StudioTls, WhatIsWrongIsToldWithItsFile) {
  const auto certificate = certificate_file(key_.get(), "crt", "IP:10.0.0.5");
  const auto key = key_file(key_.get(), "key");
  EXPECT_EQ(refusal(certificate, key), "taken");
  EXPECT_TRUE(says(refusal("/nowhere.crt", key), "/nowhere.crt", "No such file"));
  EXPECT_TRUE(says(refusal(certificate, "/nowhere.key"), "/nowhere.key", "No such file"));
  EXPECT_TRUE(says(refusal(::testing::TempDir(), key), ::testing::TempDir(), "not a file"));
  const auto text = text_file("text", "no PEM at all\n");
  EXPECT_TRUE(says(refusal(text, key), text, "BEGIN CERTIFICATE")) << refusal(text, key);
  EXPECT_TRUE(says(refusal(certificate, text), text, "BEGIN PRIVATE KEY")) << refusal(certificate, text);
  EXPECT_TRUE(says(refusal(key, key), key, "BEGIN CERTIFICATE"));
  const Key other(EVP_EC_gen("P-256"), &EVP_PKEY_free);
  const auto another = key_file(other.get(), "other");
  EXPECT_TRUE(says(refusal(certificate, another), another, "another certificate")) << refusal(certificate, another);
  const auto secret = key_file(key_.get(), "secret", "abcd");
  EXPECT_TRUE(says(refusal(certificate, secret), secret, "passphrase")) << refusal(certificate, secret);
  const auto nameless = certificate_file(key_.get(), "nameless", "");
  EXPECT_TRUE(says(refusal(nameless, key), nameless, "subjectAltName"));
}

TEST_F(StudioTls, AKeyThatEveryUserCanReadIsRefused) {
  const auto certificate = certificate_file(key_.get(), "crt", "DNS:plant.example");
  const auto key = key_file(key_.get(), "key");
  for (const mode_t open : {0644U, 0606U, 0602U}) {
    ASSERT_EQ(::chmod(key.c_str(), open), 0);
    EXPECT_TRUE(says(refusal(certificate, key), key, "chmod 600"));
  }
  ASSERT_EQ(::chmod(key.c_str(), 0640), 0);
  EXPECT_EQ(refusal(certificate, key), "taken") << "Debian's ssl-cert group";
}

TEST(StudioTlsWords, ARefusedAddressGetsACommandForItsCertificate) {
  EXPECT_NE(needs_certificate({"10.0.0.5", 8302}).find("subjectAltName=IP:10.0.0.5 "), std::string::npos);
  EXPECT_NE(needs_certificate({"plant.example", 8302}).find("subjectAltName=DNS:plant.example "), std::string::npos);
  EXPECT_NE(needs_certificate({"0.0.0.0", 8302}).find("subjectAltName=DNS:$(hostname) "), std::string::npos);
}

}  // namespace berth::studio
