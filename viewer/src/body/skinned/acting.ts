import type { Actor } from '../../actor.ts';
import type { BodyLanguage } from '../../gesture/performing/body-language.ts';
import { jointMotion, Placement, type RigPose } from '../../gesture/placement.ts';
import type { Figure } from '../../gesture/figure.ts';
import type { Quat, Vector } from '../../rig/quaternions.ts';
import type { Rig } from '../../rig/rig.ts';
import type { SkinnedBody } from './body.ts';
import type { Pose } from './skeleton.ts';

/** Moves a body on a skeleton by its body language, at the place where the person was recorded. */
export class ActingBody implements Actor {
  readonly objects = [];
  readonly language: BodyLanguage;
  private readonly body: SkinnedBody;
  private readonly rig: Rig;
  private readonly recorded: RigPose;
  private readonly placement: Placement;
  private readonly head: number; // index of the head's joint
  private readonly visitor: () => Vector;
  /** The current pose in the world. */
  pose: RigPose;
  /** A pose to keep instead of acting; null to act. */
  held: RigPose | null = null;

  /**
   * @param frame frame of the recording whose place and direction the person keeps
   * @param visitor returns the position of the visitor, m in the world
   */
  constructor(body: SkinnedBody, language: BodyLanguage, rig: Rig, figure: Figure, frame: number, visitor: () => Vector) {
    this.body = body;
    this.language = language;
    this.rig = rig;
    this.visitor = visitor;
    const recorded = body.generator.skeleton.empty();
    body.generator.skeleton.recorded(frame, recorded);
    this.recorded = this.pose = rigPose(recorded);
    this.placement = new Placement(rig, figure, this.recorded);
    this.head = figure.parts.find(({ role }) => role === 'head')!.joints.at(-1)!;
  }

  tick(step: number): boolean {
    this.language.look(this.placement.toRest(this.visitor()));
    this.language.advance(step);
    this.pose = this.held ?? this.placement.place(this.language.pose());
    this.body.strike(this.pose.rotations.flat(), this.pose.root);
    return true;
  }

  /** Rigid motion of the head from where it was in that frame: a point x of it moves to q·x + shift, m. */
  headMotion(): [Quat, Vector] {
    return jointMotion(this.rig, this.head, this.recorded, this.pose);
  }
}

function rigPose({ rotations, root }: Pose): RigPose {
  const quats = Array.from({ length: rotations.length / 4 }, (_, i): Quat => {
    return [rotations[4 * i]!, rotations[4 * i + 1]!, rotations[4 * i + 2]!, rotations[4 * i + 3]!];
  });
  return { rotations: quats, root: [root[0]!, root[1]!, root[2]!] };
}
