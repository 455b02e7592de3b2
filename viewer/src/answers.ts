// The answers of raters to the episodes of one page, kept in the browser by the rater's name, and their CSV file.
export type Answer = 'yes' | 'no' | 'unsure';
export const ANSWERS: Answer[] = ['yes', 'no', 'unsure'];

// 32 bits of a text (FNV-1a): pages of other episodes keep theirs elsewhere.
function mark(text: string): string {
  let hash = 0x811c9dc5;
  for (let i = 0; i < text.length; ++i) hash = Math.imul(hash ^ text.charCodeAt(i), 0x01000193);
  return (hash >>> 0).toString(16).padStart(8, '0');
}

function quoted(field: string): string { return /[",;\t\r\n#]/.test(field) ? `"${field.replaceAll('"', '""')}"` : field; }

export class Answers {
  rater = '';
  stored = true; // false: this browser keeps nothing, and what is not exported is lost
  private exported = true; // since the last answer
  private given = new Map<string, Answer>(); // by the episode's key
  private readonly others = new Map<string, Map<string, Answer>>(); // of raters before, where nothing is stored
  private readonly place: string;

  constructor(private readonly keys: string[]) {
    this.place = `duet-rate/${mark(keys.join())}`;
    this.choose(this.load('name') ?? '');
  }

  // Another rater, with the answers that this one has given before.
  choose(name: string): void {
    this.others.set(this.rater, this.given);
    this.rater = name.replace(/[\u0000-\u001f\u007f]/g, ' ').trim();
    this.save('name', this.rater);
    this.given = this.others.get(this.rater) ?? new Map();
    this.gather();
  }

  // Takes over what is stored of this rater, by this page or by the same one in another tab.
  gather(): void {
    try {
      for (const [key, answer] of Object.entries(JSON.parse(this.load(`of/${this.rater}`) ?? '{}')))
        if (ANSWERS.includes(answer as Answer)) this.given.set(key, answer as Answer);
    } catch { /* what somebody else has written there is no answer */ }
  }

  of(key: string): Answer | undefined { return this.given.get(key); }
  get count(): number { return this.keys.filter((key) => this.given.has(key)).length; }

  give(key: string, answer: Answer): void {
    this.gather();
    this.given.set(key, answer);
    this.exported = false;
    this.save(`of/${this.rater}`, JSON.stringify(Object.fromEntries(this.given)));
  }

  // Whether an answer is neither stored nor exported.
  get endangered(): boolean { return !this.stored && !this.exported; }

  // In the order of the page; what is not answered is left out.
  csv(): string {
    this.gather();
    this.exported = true;
    const lines = this.keys.filter((key) => this.given.has(key)).map((key) => `${key},${quoted(this.rater)},${this.given.get(key)}\n`);
    return `episode,rater,answer\n${lines.join('')}`;
  }

  private load(name: string): string | null {
    try {
      return localStorage.getItem(`${this.place}/${name}`);
    } catch {
      this.stored = false;
      return null;
    }
  }

  private save(name: string, value: string): void {
    try {
      localStorage.setItem(`${this.place}/${name}`, value);
    } catch {
      this.stored = false;
    }
  }
}
