/// Certificates that the test makes with openssl: a CA, and what it signs, with any time and name.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "folder.hpp"
#include "process.hpp"

namespace berth::mqtt::test {

class Certificates {
 public:
  Certificates() {
    folder_.write("ca.cnf",
                  "[ca]\ndefault_ca = all\n[all]\ndatabase = index\nserial = serial\nnew_certs_dir = .\n"
                  "certificate = ca.crt\nprivate_key = ca.key\ndefault_md = sha256\npolicy = any\n"
                  "unique_subject = no\nemail_in_dn = no\n[any]\ncommonName = supplied\n");
    folder_.write("index", "");
    folder_.write("serial", "1000\n");
    openssl(
        "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 3650 -subj /CN=authority "
        "-addext basicConstraints=critical,CA:TRUE -keyout ca.key -out ca.crt");
  }

  /// NAME.crt and NAME.key; `names`: "DNS:localhost,IP:127.0.0.1". Times as openssl ca has them: "20200101000000Z".
  void make(const std::string& name, const std::string& names, const std::string& from = "20200101000000Z",
            const std::string& to = "20991231235959Z") const {
    folder_.write(name + ".ext", "subjectAltName = " + names + "\nbasicConstraints = CA:FALSE\n");
    openssl("req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=" + name + " -keyout " + name +
            ".key -out " + name + ".req");
    openssl("ca -batch -notext -config ca.cnf -extfile " + name + ".ext -startdate " + from + " -enddate " + to +
            " -in " + name + ".req -out " + name + ".crt");
  }
  void openssl(const std::string& arguments) const {
    const auto command = "cd '" + folder_.file("") + "' && openssl " + arguments;
    EXPECT_EQ(run({"sh", "-c", command}, folder_.file("log")), 0) << command << '\n' << folder_.read("log");
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_.file(name); }
  [[nodiscard]] const Folder& folder() const { return folder_; }
  [[nodiscard]] std::string authorities() const { return file("ca.crt"); }
  /// Lines for a listener of Mosquitto.
  [[nodiscard]] std::string listener(const std::string& name) const {
    return "certfile " + file(name + ".crt") + "\nkeyfile " + file(name + ".key");
  }

 private:
  Folder folder_;
};

}  // namespace berth::mqtt::test
