/** \file
 * What the rest of the car hears: the fields of a line, and sockets that nobody holds up. */
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "core/errors.h"
#include "pipeline/line_stream.h"
#include "pipeline/output_json.h"
#include "support/files.h"
#include "support/sensors.h"

namespace raceloc {
namespace {

using namespace test;
using ::testing::HasSubstr;

LocalizerOutput someOutput() {
  LocalizerOutput output{};
  output.stamp_s = 1.5e9 + 0.125;
  output.T_map_body = poseFromRpy({1, 2, 3}, 0.1, -0.2, 0.3);
  for (int i = 0; i < 36; ++i) output.covariance(i / 6, i % 6) = 0.25 * i;
  output.speed_mps = 70;
  output.yaw_rate_rps = 0.4;
  output.decision = DatedDecision{};
  output.decision->decision = {GateRule::rejected_some,
                               {{"scan_match", 0.1, 5, 0.4, 1, true}, {"gps_left", 8.5, 5, 0.01, 0, false}},
                               false};
  output.integrity = {
      LocalizationState::degraded, "gps_left: leaves the others", 8.5, 5, {0.3, 0.4, 0.01}, 1.5};
  Wall wall{};
  wall.side = Side::right;
  wall.beta = {-4, 0.1, 0.002};
  wall.covariance = 0.0004 * Eigen::Matrix3d::Identity();
  WallReport report{};
  report.walls = {1.5e9 + 0.1, ScanVerdict::good, std::nullopt, wall};
  report.guard.state = GuardState::wall_following;
  report.guard.clearance.side = Side::right;
  report.guard.clearance.wheel_m = 3;
  report.guard.path = WallPath{Side::right, 2.5, {{0, 0, 0, 0, 0}, {1, 1, 0.25, 0.1, 0.05}}, 30, 20, true};
  output.walls = report;
  return output;
}

TEST(OutputJson, HoldsEveryFieldInItsPlace) {
  const auto json = nlohmann::json::parse(outputJson(someOutput(), {7, 0.02}));
  EXPECT_EQ(json.at("number"), 7);
  EXPECT_EQ(json.at("stamp_s"), 1.5e9 + 0.125);
  EXPECT_EQ(json.at("age_s"), 0.02);
  EXPECT_EQ(json.at("pose").at("z_m"), 3);
  EXPECT_NEAR(json.at("pose").at("roll_rad"), 0.1, 1e-12);
  EXPECT_NEAR(json.at("pose").at("pitch_rad"), -0.2, 1e-12);
  EXPECT_NEAR(json.at("pose").at("yaw_rad"), 0.3, 1e-12);
  ASSERT_EQ(json.at("covariance").size(), 36U);
  EXPECT_EQ(json.at("covariance").at(1), 0.25);  // row by row
  EXPECT_EQ(json.at("speed_mps"), 70);
  EXPECT_EQ(json.at("yaw_rate_rps"), 0.4);
  EXPECT_EQ(json.at("state"), "degraded");
  EXPECT_EQ(json.at("cause"), "gps_left: leaves the others");
  EXPECT_EQ(json.at("measured"), 8.5);
  EXPECT_EQ(json.at("limit"), 5);
  EXPECT_EQ(json.at("protection").at("longitudinal_m"), 0.4);
  EXPECT_EQ(json.at("alert_limit_m"), 1.5);
  EXPECT_EQ(json.at("rule"), 3);
  EXPECT_EQ(json.at("alarm"), false);
  ASSERT_EQ(json.at("sources").size(), 2U);
  EXPECT_EQ(json.at("sources").at(1).at("source"), "gps_left");
  EXPECT_EQ(json.at("sources").at(1).at("accepted"), false);
  EXPECT_EQ(json.at("sources").at(1).at("p_theta"), 0.01);
  const auto& walls = json.at("walls");
  EXPECT_EQ(walls.at("scan"), "good");
  EXPECT_TRUE(walls.at("left").is_null());
  EXPECT_EQ(walls.at("right").at("distance_m"), 4);
  EXPECT_NEAR(walls.at("right").at("distance_sigma_m"), 0.02, 1e-12);
  EXPECT_EQ(walls.at("right").at("beta"), nlohmann::json({-4, 0.1, 0.002}));
  EXPECT_EQ(walls.at("guard"), "wall_following");
  EXPECT_EQ(walls.at("nearest"), "right");
  EXPECT_EQ(walls.at("wheel_to_wall_m"), 3);
  EXPECT_TRUE(walls.at("time_to_wall_s").is_null());
  EXPECT_EQ(walls.at("path").at("points").at(1), nlohmann::json({1, 0.25, 0.1, 0.05}));
}

TEST(OutputJson, WhatIsNotThereIsNull) {
  LocalizerOutput output = someOutput();
  output.decision.reset();
  output.walls.reset();
  output.integrity.protection.lateral_m = std::numeric_limits<double>::infinity();
  output.integrity.cause = "\xff is no UTF-8";
  const auto json = nlohmann::json::parse(outputJson(output, {1, std::nullopt}));
  EXPECT_TRUE(json.at("age_s").is_null());
  EXPECT_TRUE(json.at("protection").at("lateral_m").is_null());
  EXPECT_EQ(json.at("rule"), 0);
  EXPECT_TRUE(json.at("walls").is_null());
  EXPECT_TRUE(json.at("sources").is_array());
  EXPECT_TRUE(json.at("sources").empty());
}

TEST(OutputJson, EveryFieldIsDescribed) {
  const auto manual = readFile(RACELOC_ROOT "/share/clients/README.md");
  const auto json = nlohmann::json::parse(outputJson(someOutput(), {1, 0.0}));
  const auto expectNamed = [&](const nlohmann::json& object) {
    for (const auto& [key, value] : object.items()) EXPECT_THAT(manual, HasSubstr(key + "`"));
  };
  expectNamed(json);
  expectNamed(json.at("pose"));
  expectNamed(json.at("protection"));
  expectNamed(json.at("sources").at(0));
  expectNamed(json.at("walls"));
  expectNamed(json.at("walls").at("right"));
  expectNamed(json.at("walls").at("path"));
}

/** A client of TCP that reads when it is told to. */
class Client {
 public:
  explicit Client(const std::string& url) : x_socket(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1))));
    if (connect(x_socket, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("cannot connect to " + url);
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() { close(x_socket); }
  /** Waits until `bytes` more are there, or the other end is closed. */
  std::string read(std::size_t bytes) const {
    std::string text(bytes, '\0');
    const auto n = recv(x_socket, text.data(), bytes, MSG_WAITALL);
    text.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
    return text;
  }

 private:
  int x_socket;
};

TEST(LineStream, ASlowClientIsDroppedAndTheOthersGoOn) {
  LineStream stream("tcp://127.0.0.1:0");
  const Client reads(stream.url()), sleeps(stream.url());
  const std::string line(4095, 'x');
  constexpr int kEnough = 20'000;  // 80 MB: no socket buffers that much
  int sent = 0;
  for (; sent < kEnough && stream.lost() == 0; ++sent) {
    stream.send(line);
    ASSERT_EQ(reads.read(line.size() + 1), line + "\n");
  }
  EXPECT_EQ(stream.lost(), 1U);
  EXPECT_EQ(stream.listeners(), 1U);
  stream.send("still there");
  EXPECT_EQ(reads.read(12), "still there\n");
}

TEST(LineStream, AClientThatLeavesIsNoLoss) {
  LineStream stream("tcp://127.0.0.1:0");
  {
    const Client leaves(stream.url());
    stream.send("hello");
    EXPECT_EQ(leaves.read(6), "hello\n");
    EXPECT_EQ(stream.listeners(), 1U);
  }
  for (int i = 0; i < 1000 && stream.listeners() > 0; ++i) stream.send("anyone?");
  EXPECT_EQ(stream.listeners(), 0U);
  EXPECT_EQ(stream.lost(), 0U);
}

TEST(LineStream, OverUdpItSendsWhetherOrNotSomebodyListens) {
  LineStream nobody("udp://127.0.0.1:" + std::to_string(freeUdpPort()));
  for (int i = 0; i < 10; ++i) nobody.send("hello");
  const UdpSocket somebody;
  LineStream stream("udp://localhost:" + std::to_string(somebody.port()));
  stream.send("one");
  stream.send("two");
  std::array<char, 16> text{};
  EXPECT_EQ(recv(somebody.handle(), text.data(), text.size(), 0), 4);
  EXPECT_EQ(recv(somebody.handle(), text.data(), text.size(), 0), 4);
  EXPECT_EQ(std::string(text.data(), 4), "two\n");
  EXPECT_EQ(stream.lost(), 0U);
}

TEST(LineStream, APortThatIsTakenIsRefused) {
  const LineStream first("tcp://127.0.0.1:0");
  EXPECT_THROW(LineStream{first.url()}, InputError);
}

}  // namespace
}  // namespace raceloc
