import unittest

import frames
import source


def findings(code):
    return [finding.message for finding in frames.check(source.Project({"slam/a.cpp": code}))]


class Products(unittest.TestCase):
    def assert_accepts(self, code):
        self.assertEqual(findings(code), [], code)

    def assert_refuses(self, code, kind="inner", count=1):
        found = findings(code)
        self.assertEqual(len(found), count, f"{code}: {found}")
        self.assertTrue(found[0].startswith(f"{kind} frames differ"), found)

    def test_inner_frames_cancel(self):
        self.assert_accepts("auto x = T_a_b * T_b_c * T_c_d;")
        self.assert_refuses("auto x = T_a_b * T_c_d;")
        self.assert_refuses("auto x = T_a_b * T_b_c * T_b_d;")

    def test_inverse_and_transpose_swap(self):
        self.assert_accepts("auto x = T_b_a.inverse() * T_b_c;")
        self.assert_refuses("auto x = T_a_b.inverse() * T_b_c;")
        self.assert_accepts("auto x = R_a_b * R_c_b.transpose();")
        self.assert_accepts("auto x = T_a_b.inverse().inverse() * T_b_c;")

    def test_rotations_keep_frames(self):
        self.assert_accepts("auto x = T_a_b.rotation() * T_b_c.rotation_matrix();")
        self.assert_refuses("auto x = T_a_b.rotation() * T_a_c.rotation();")
        self.assert_refuses("auto x = T_a_b.template cast<double>() * T_a_c;")

    def test_members_with_underscore_and_behind_objects(self):
        self.assert_accepts("auto x = T_a_b_ * frame->T_b_c;")
        self.assert_refuses("auto x = config_.T_a_b_ * frames[0].T_a_c;")
        self.assert_refuses("auto x = map.at(key).T_a_b * T_a_c;")

    def test_points_and_vectors(self):
        self.assert_accepts("auto x = T_a_b * p_b;")
        self.assert_refuses("auto x = T_a_b * p_a;")
        self.assert_accepts("auto x = R_a_b * p_b_c;")
        self.assert_accepts("auto x = R_odom_base * v_odom_base_in_base;")
        self.assert_refuses("auto x = R_odom_base * v_odom_base;")
        self.assert_accepts("auto x = R_a_b * T_b_c.translation();")
        self.assert_refuses("auto x = R_a_b * T_c_b.translation();")

    def test_numbered_instances(self):
        self.assert_accepts("auto x = T_odom_cam0 * T_cam0_cam1;")
        self.assert_accepts("auto x = T_odom_base1 * T_base_cam;")
        self.assert_refuses("auto x = T_odom_cam0 * T_cam1_cam0;")

    def test_line_continuation(self):
        self.assert_accepts("auto x = T_a_b *\n    T_b_c;")
        found = frames.check(source.Project({"slam/a.cpp": "auto x = T_a_b *  // map\n    T_c_d;"}))
        self.assertEqual([finding.line for finding in found], [2])

    def test_inside_arguments_and_parentheses(self):
        self.assert_refuses("f(g(T_a_b * T_c_d), 1);")
        self.assert_refuses("auto x = map.find(T_a_b * T_c_d).y * 2;")
        self.assert_refuses("auto x = s * (T_a_b * p_c);")

    def test_unknown_factors_say_nothing(self):
        self.assert_accepts("auto x = T_a_b * SE3::exp(xi) * T_c_d;")
        self.assert_accepts("auto x = T_a_b * guess(T_c_d);")
        self.assert_accepts("auto x = T_a_b + T_c_d; int* p_c = nullptr;")

    def test_comments_and_literals_are_no_code(self):
        self.assert_accepts('// T_a_b * T_c_d\nlog("T_a_b * T_c_d"); /* T_a_b *\n T_c_d */')

    def test_outer_frames_of_an_assignment(self):
        self.assert_accepts("const SE3 T_a_c = T_a_b * T_b_c;")
        self.assert_refuses("const SE3 T_c_a = T_a_b * T_b_c;", "outer")
        self.assert_refuses("SE3 T_a_b{T_b_a};", "outer")
        self.assert_refuses("p_b = T_a_b * p_b;", "outer")
        self.assert_accepts("p_a = T_a_b * p_b;")
        self.assert_accepts("T_a_c = T_a_b * T_b_c + x;")
        self.assert_accepts("return T_a_c == T_a_b * T_b_c;")

    def test_a_pose_of_another_object_may_be_named(self):
        self.assert_accepts("const SE3& T_odom_anchor = anchor.T_odom_cam;")
        self.assert_refuses("const SE3& T_odom_anchor = anchor.T_map_cam;", "outer")
        self.assert_refuses("const SE3& T_odom_anchor = T_odom_cam;", "outer")

    def test_a_role_takes_any_frame(self):
        self.assert_accepts("send({.T_parent_child = T_odom_base});")
        self.assert_accepts("const SE3& T_previous_cam = found.T_target_source;")
        self.assert_refuses("auto x = T_odom_base * T_parent_child;")

    def test_a_reason_excuses(self):
        self.assert_accepts("auto x = T_a_b * T_c_d;  // frames: b is c in the first packet")
        self.assert_refuses("auto x = T_a_b * T_c_d;  // frames:")
