// TLS: who is let through, and the words for each fault, against Mosquitto and openssl's own server.
#include "berth/mqtt/tls.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <thread>

#include "../pch.hpp"
#include "berth/mqtt/tls_cache.hpp"
#include "certificates.hpp"
#include "heard.hpp"
#include "raw_broker.hpp"

namespace berth::mqtt {
namespace {

using namespace std::chrono_literals;
using test::Broker;
using test::is_up;
using test::quick;
using test::Station;
using test::Story;

class MqttTls : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made = std::make_unique<test::Certificates>();
    made->make("good", "DNS:localhost,IP:127.0.0.1");
    made->make("expired", "DNS:localhost,IP:127.0.0.1", "20200101000000Z", "20210101000000Z");
    made->make("early", "DNS:localhost,IP:127.0.0.1", "20980101000000Z");
    made->make("other", "DNS:other.example");
    made->make("client", "DNS:client");
  }
  static void TearDownTestSuite() { made.reset(); }
  static Options options(const Broker& broker, Version version = Version::v5, const std::string& host = "127.0.0.1") {
    auto options = quick(broker.where(true, host), "one", version);
    options.tls.authorities = made->authorities();
    options.subscriptions = {"a"};
    return options;
  }
  static Disconnected first_failure(const Options& options) {
    Station station(options);
    EXPECT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty() || s.is_connected(); }));
    const auto story = station.heard.story();
    EXPECT_TRUE(story.connected.empty());
    return story.disconnected.empty() ? Disconnected() : story.disconnected[0];
  }
  static inline std::unique_ptr<test::Certificates> made;
};

}  // namespace

TEST_F(MqttTls, ATrustedBrokerByNameAndByAddress) {
  NEEDS_BROKER();
  const Broker broker(made->listener("good"));
  for (const auto version : {Version::v5, Version::v3_1_1}) {
    for (const std::string host : {"localhost", "127.0.0.1"}) {
      auto chosen = options(broker, version, host);
      chosen.limits.outgoing_bytes = 10'000'000;
      Station station(chosen);
      ASSERT_TRUE(station.heard.until(is_up));
      ASSERT_TRUE(station.publish("a", std::string(200'000, 'x')));
      for (int i = 0; i < 20; ++i) ASSERT_TRUE(station.publish("b", std::string(100'000, 'x'), Qos::at_most_once));
      ASSERT_TRUE(station.heard.until([](const Story& s) { return s.has("a") && s.published.size() == 21; }));
      EXPECT_EQ(station.heard.story().messages[0].payload, std::string(200'000, 'x'));
      station.client->end(Parting::without_will);
      EXPECT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
      EXPECT_NE(station.heard.story().disconnected[0].words.find("this client ended the connection"),
                std::string::npos);
    }
  }
}

TEST_F(MqttTls, ABrokerThatNobodyVouchesFor) {
  NEEDS_BROKER();
  const Broker broker(made->listener("good"));
  auto chosen = options(broker);
  chosen.tls.authorities = {};  // those of the system
  const auto told = first_failure(chosen);
  EXPECT_EQ(told.why, Why::certificate_untrusted) << told.words;
  EXPECT_NE(told.words.find("name the file of its CA"), std::string::npos) << told.words;
}

TEST_F(MqttTls, AnExpiredCertificate) {
  NEEDS_BROKER();
  const Broker broker(made->listener("expired"));
  const auto told = first_failure(options(broker));
  EXPECT_EQ(told.why, Why::certificate_expired) << told.words;
  EXPECT_NE(told.words.find("has expired: renew it"), std::string::npos) << told.words;
}

TEST_F(MqttTls, ACertificateThatIsNotValidYet) {
  NEEDS_BROKER();
  const Broker broker(made->listener("early"));
  const auto told = first_failure(options(broker));
  EXPECT_EQ(told.why, Why::certificate_early) << told.words;
}

TEST_F(MqttTls, ACertificateForAnotherName) {
  NEEDS_BROKER();
  const Broker broker(made->listener("other"));
  for (const std::string host : {"127.0.0.1", "localhost"}) {
    const auto told = first_failure(options(broker, Version::v5, host));
    EXPECT_EQ(told.why, Why::certificate_name) << told.words;
    EXPECT_NE(told.words.find("certificate is not for " + host), std::string::npos) << told.words;
  }
}

TEST_F(MqttTls, ABrokerThatWantsACertificate) {
  NEEDS_BROKER();
  const Broker broker(made->listener("good") + "\nrequire_certificate true\ncafile " + made->authorities());
  const auto told = first_failure(options(broker));
  EXPECT_EQ(told.why, Why::own_certificate) << told.words;
  EXPECT_NE(told.words.find("wants a certificate from this client"), std::string::npos) << told.words;
  auto chosen = options(broker);
  chosen.tls.certificate = made->file("client.crt");
  chosen.tls.key = made->file("client.key");
  Station station(chosen);
  EXPECT_TRUE(station.heard.until(is_up));
}

TEST_F(MqttTls, TlsWhereThereIsNoneAndNoneWhereThereIs) {
  NEEDS_BROKER();
  const Broker plain;
  const auto no_tls = first_failure(options(plain));
  EXPECT_EQ(no_tls.why, Why::tls) << no_tls.words;
  const Broker secured(made->listener("good"));
  const auto without = first_failure(quick(secured.where(), "one", Version::v5));
  EXPECT_EQ(without.why, Why::closed) << without.words;
  EXPECT_NE(without.words.find("mqtts://"), std::string::npos) << without.words;
  const test::RawBroker raw;
  auto chosen = options(plain);
  chosen.where = raw.where();
  chosen.where.tls = true;
  Station station(chosen);
  raw.accept().say("HTTP/1.1 400 Bad Request\r\n\r\n");
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  EXPECT_NE(station.heard.story().disconnected[0].words.find("does not speak TLS at this port"), std::string::npos)
      << station.heard.story().disconnected[0].words;
}

// A broker with certificates for several names chooses by the name it is asked for (SNI), also when it was looked up.
TEST_F(MqttTls, TheNameIsAskedFor) {
  const auto port = test::free_port();
  const std::string accept = "127.0.0.1:" + std::to_string(port);
  test::Process server(
      {"openssl", "s_server", "-accept", accept, "-cert", made->file("other.crt"), "-key", made->file("other.key"),
       "-servername", "localhost", "-cert2", made->file("good.crt"), "-key2", made->file("good.key"), "-www"},
      made->file("server.log"));
  const auto end = std::chrono::steady_clock::now() + test::patience;
  while (!test::listens(port) && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(10ms);
  auto chosen = quick({true, "localhost", port}, "one", Version::v5);
  chosen.tls.authorities = made->authorities();
  chosen.answer_within = 2'000ms;
  const auto named = first_failure(chosen);
  EXPECT_EQ(named.why, Why::no_answer) << "the certificate is good, and no broker is behind it: " << named.words;
  chosen.where.host = "127.0.0.1";
  const auto by_address = first_failure(chosen);
  EXPECT_EQ(by_address.why, Why::certificate_name) << by_address.words;
}

TEST_F(MqttTls, FilesThatCannotBeUsedAreRefusedWithTheReason) {
  const auto why = [](const TlsFiles& files) { return Tls::load(files, "localhost").error(); };
  const auto& folder = made->folder();
  EXPECT_TRUE(Tls::load({made->authorities(), made->file("client.crt"), made->file("client.key")}, "localhost"));
  EXPECT_TRUE(Tls::load({}, "localhost"));
  EXPECT_EQ(why({folder.file("none.crt"), "", ""}), folder.file("none.crt") + ": No such file or directory");
  EXPECT_NE(why({folder.write("empty.crt", ""), "", ""}).find("give certificates of CAs in PEM"), std::string::npos);
  EXPECT_EQ(why({"", folder.file("none.crt"), made->file("client.key")}),
            folder.file("none.crt") + ": No such file or directory");
  EXPECT_NE(why({"", made->file("client.key"), made->file("client.key")}).find("give a certificate in PEM"),
            std::string::npos);
  EXPECT_EQ(why({"", made->file("client.crt"), made->file("good.key")}),
            made->file("good.key") + ": this is the key of another certificate than " + made->file("client.crt"));
  EXPECT_NE(why({"", made->file("client.crt"), folder.write("no.key", "nonsense")}).find("give a private key in PEM"),
            std::string::npos);
  made->openssl("pkey -in client.key -aes256 -passout pass:secret -out locked.key");
  EXPECT_NE(why({"", made->file("client.crt"), made->file("locked.key")}).find("has a passphrase; remove it"),
            std::string::npos);
  made->openssl("pkey -in client.key -out open.key");
  ASSERT_EQ(::chmod(made->file("open.key").c_str(), 0644), 0);
  EXPECT_EQ(
      why({"", made->file("client.crt"), made->file("open.key")}),
      made->file("open.key") + ": every user of this computer can read this key: chmod 600 " + made->file("open.key"));
}

// A renewed certificate is taken without a new start; otherwise files are read once.
TEST_F(MqttTls, ChangedFilesAreReadAgain) {
  const test::Folder folder;
  const auto ca = folder.write("ca.crt", made->folder().read("ca.crt"));
  TlsCache cache;
  const auto first = cache.get({ca, "", ""}, "localhost").value();
  EXPECT_EQ(cache.get({ca, "", ""}, "localhost").value(), first);
  EXPECT_NE(cache.get({ca, "", ""}, "127.0.0.1").value(), first);
  folder.write("ca.crt", made->folder().read("ca.crt") + "\n");
  const auto second = cache.get({ca, "", ""}, "localhost").value();
  EXPECT_NE(second, first);
  folder.write("ca.crt", "nonsense");
  EXPECT_FALSE(cache.get({ca, "", ""}, "localhost"));
}

}  // namespace berth::mqtt
