// Who is let in: tokens, and the names by which a request says whom it means and where it comes from.
#include "berth/studio/doors.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "../pch.hpp"

namespace berth::studio {

TEST(StudioDoors, TokensAreLongAndNeverTheSame) {
  const auto token = make_token();
  EXPECT_EQ(token.size(), 64U);
  EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_NE(token, make_token());
}

TEST(StudioDoors, OnlyTheWholeTokenIsTheToken) {
  const std::string token = make_token();
  EXPECT_TRUE(same_token(token, token));
  std::string last = token;
  last.back() = last.back() == '0' ? '1' : '0';
  EXPECT_FALSE(same_token(last, token));
  EXPECT_FALSE(same_token(token + token, token));
  EXPECT_FALSE(same_token(token.substr(1), token));
  EXPECT_FALSE(same_token("", token));
  EXPECT_FALSE(same_token("", ""));
  EXPECT_FALSE(same_token("x", ""));
}

TEST(StudioDoors, TheTokensFileIsItsUsersAloneAndFollowsNoLink) {
  const std::string path = fmt::format("{}/token_{}", ::testing::TempDir(), ::getpid());
  const std::string other = path + ".other";
  std::ofstream(other) << "untouched";
  ASSERT_EQ(::symlink(other.c_str(), path.c_str()), 0);
  {
    const auto tokens = Tokens::make();
    ASSERT_TRUE(tokens);
    const auto file = TokenFiles::write(path, *tokens);
    ASSERT_TRUE(file) << file.error();
    struct stat status {};
    ASSERT_EQ(::lstat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode, S_IFREG | 0600U);
    std::string text;
    std::getline(std::ifstream(path), text);
    EXPECT_EQ(text, tokens->of(command::Role::configure));
    std::getline(std::ifstream(path + ".view"), text);
    EXPECT_EQ(text, tokens->of(command::Role::view));
  }
  for (const char* end : {"", ".view", ".operate"}) EXPECT_NE(::access((path + end).c_str(), F_OK), 0) << end;
  std::string text;
  std::getline(std::ifstream(other), text);
  EXPECT_EQ(text, "untouched");
  ::unlink(other.c_str());
  EXPECT_FALSE(TokenFiles::write("/nowhere/at/all", *Tokens::make()));
}

TEST(StudioDoors, EachRoleHasItsToken) {
  const auto tokens = Tokens::make();
  ASSERT_TRUE(tokens);
  for (const auto role : command::all_roles) EXPECT_EQ(tokens->role_of(tokens->of(role)), role);
  EXPECT_EQ(tokens->role_of(make_token()), std::nullopt);
  EXPECT_EQ(tokens->role_of(""), std::nullopt);
  EXPECT_EQ(Tokens().role_of(""), std::nullopt);
}

TEST(StudioDoors, KeptTokensAreTheSameAgainAndABadFileIsToldByItsLine) {
  const std::string path = fmt::format("{}/tokens_{}", ::testing::TempDir(), ::getpid());
  ::unlink(path.c_str());
  const auto made = Tokens::keep(path);
  ASSERT_TRUE(made) << made.error();
  struct stat status {};
  ASSERT_EQ(::stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  const auto again = Tokens::keep(path);
  ASSERT_TRUE(again) << again.error();
  for (const auto role : command::all_roles) EXPECT_EQ(again->of(role), made->of(role));
  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  EXPECT_NE(Tokens::keep(path).error().find("chmod 600"), std::string::npos);
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  const std::string a(64, 'a'), b(64, 'b'), c(64, 'c');
  const auto refusal = [&](const std::string& text) {
    std::ofstream(path) << text;
    const auto read = Tokens::keep(path);
    return read ? std::string() : read.error();
  };
  EXPECT_EQ(refusal("view " + a + "\noperate " + b + "\nconfigure " + c + "\n"), "");
  EXPECT_EQ(refusal("view " + a + "\noperate short\n").find(path + ":2: "), 0U);
  EXPECT_EQ(refusal("owner " + a + "\n").find(path + ":1: "), 0U);
  EXPECT_NE(refusal("view " + a + "\noperate " + b + "\n").find("configure"), std::string::npos);
  EXPECT_NE(refusal("view " + a + "\noperate " + b + "\nconfigure " + a + "\n").find("same"), std::string::npos);
  EXPECT_NE(refusal(""), "");
  ::unlink(path.c_str());
  EXPECT_NE(Tokens::keep("/nowhere/at/all").error().find("/nowhere/at/all: "), std::string::npos);
}

TEST(StudioDoors, HostsAreThisServersOwn) {
  for (const char* good : {"127.0.0.1:8302", "localhost:8302", "LOCALHOST:8302", "[::1]:8302"})
    EXPECT_TRUE(is_own_host(good, 8302)) << good;
  for (const char* bad : {"", "127.0.0.1", "127.0.0.1:8303", "evil.example:8302", "127.0.0.1.evil.example:8302",
                          ":8302", "127.0.0.1:08302", "localhost:8302 ", "x@127.0.0.1:8302"})
    EXPECT_FALSE(is_own_host(bad, 8302)) << bad;
}

TEST(StudioDoors, TheNameInAHost) {
  EXPECT_EQ(name_in_host("plant.example:8302", 8302), "plant.example");
  EXPECT_EQ(name_in_host("[fe80::1]:8302", 8302), "fe80::1");
  EXPECT_EQ(name_in_host("plant.example", 443), "plant.example");
  EXPECT_EQ(name_in_host("[::1]", 443), "::1");
  for (const char* bad : {"", ":8302", "plant.example", "plant.example:8303", "plant.example:", "[::1", "[::1]8302",
                          "a:b:8302", "plant.example:08302"})
    EXPECT_EQ(name_in_host(bad, 8302), "") << bad;
}

TEST(StudioDoors, WhereTheTokenStands) {
  EXPECT_EQ(token_offered("berth.v1, token.abc"), "abc");
  EXPECT_EQ(token_offered("token.abc,berth.v1"), "abc");
  EXPECT_EQ(token_offered("token.abc"), "");
  EXPECT_EQ(token_offered("berth.v1"), "");
  EXPECT_EQ(token_offered(",,,"), "");
  EXPECT_EQ(bearer("Bearer abc"), "abc");
  EXPECT_EQ(bearer("bearer  abc "), "abc");
  EXPECT_EQ(bearer("Basic abc"), "");
  EXPECT_EQ(bearer("Bearer "), "");
}

}  // namespace berth::studio
